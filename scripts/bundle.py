"""Adjust a bundle of photos inside Blender, without a window.

blender --background --python scripts/bundle.py -- PROJECT.json --out PROJECT_adjusted.json
python scripts/bundle.py -- PROJECT.json --out PROJECT_adjusted.json    (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("bundle")
