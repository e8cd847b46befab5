"""Make a mock-up model from photos of facades inside Blender, without a window.

blender --background --python scripts/facade.py -- IMAGE.jpg --out MOCKUP.ifc
python scripts/facade.py -- IMAGE.jpg --out MOCKUP.ifc          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("facade")
