"""Survey what scans are worth for an IFC model inside Blender, without a window.

blender --background --python scripts/quality.py -- MODEL.ifc SCAN.e57 --out QUALITY.ifc --blend SCENE.blend
python scripts/quality.py -- MODEL.ifc SCAN.e57 --out QUALITY.ifc          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("quality")
