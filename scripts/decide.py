"""Overrule the verdict on elements of a verified IFC inside Blender, without a window.

blender --background --python scripts/decide.py -- VERIFIED.ifc --element GUID --status CONFIRMED --reason TEXT --out OUT.ifc
python scripts/decide.py -- VERIFIED.ifc --element GUID ... (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("decide")
