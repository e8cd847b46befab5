"""Assign every return of scans to its element inside Blender, without a window.

blender --background --python scripts/classify.py -- MODEL.ifc SCAN.e57 --out CLASSIFIED.e57
python scripts/classify.py -- MODEL.ifc SCAN.e57 --out CLASSIFIED.e57          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("classify")
