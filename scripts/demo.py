"""Make the demo house, scan it and verify it inside Blender, without a window.

blender --background --python scripts/demo.py -- --out DIR
python scripts/demo.py -- --out DIR          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("demo")
