"""Make a building model from scans inside Blender, without a window.

blender --background --python scripts/reconstruct.py -- SCAN.e57 --out MODEL.ifc
python scripts/reconstruct.py -- SCAN.e57 --out MODEL.ifc          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("reconstruct")
