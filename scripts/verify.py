"""Verify an IFC model against scans inside Blender, without a window.

blender --background --python scripts/verify.py -- MODEL.ifc SCAN.e57 --out VERIFIED.ifc --blend SCENE.blend
python scripts/verify.py -- MODEL.ifc SCAN.e57 --out VERIFIED.ifc          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("verify")
