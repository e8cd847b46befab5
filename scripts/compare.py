"""Compare a building model with another inside Blender, without a window.

blender --background --python scripts/compare.py -- MODEL.ifc REFERENCE.ifc --report REPORT
python scripts/compare.py -- MODEL.ifc REFERENCE.ifc --report REPORT          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("compare")
