"""Say what changed between epochs and against the model inside Blender, without a window.

blender --background --python scripts/change.py -- MODEL.ifc --epoch SCAN.e57 --out CHANGED.ifc --blend SCENE.blend
python scripts/change.py -- MODEL.ifc --epoch SCAN.e57 --out CHANGED.ifc          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("change")
