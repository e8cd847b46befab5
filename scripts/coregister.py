"""Place photos on the model inside Blender, without a window.

blender --background --python scripts/coregister.py -- MODEL.ifc a.jpg b.jpg --cameras cameras.json --out cameras_refined.json
python scripts/coregister.py -- MODEL.ifc a.jpg --cameras cameras.json --out cameras_refined.json    (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("coregister")
