"""Say what IFC and scan files hold inside Blender, without a window.

blender --background --python scripts/info.py -- FILE...
python scripts/info.py -- FILE...          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("info")
