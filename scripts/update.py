"""Move displaced elements of a verified model to where they stand, inside Blender, without a window.

blender --background --python scripts/update.py -- VERIFIED.ifc --out UPDATED.ifc
python scripts/update.py -- VERIFIED.ifc --out UPDATED.ifc          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("update")
