"""Plan where to stand a scanner inside Blender, without a window.

blender --background --python scripts/plan.py -- MODEL.ifc --loa 30 --out stations.json --blend SCENE.blend
python scripts/plan.py -- MODEL.ifc --loa 30 --out stations.json          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("plan")
