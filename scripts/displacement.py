"""Say how a panelled wall has moved inside Blender, without a window.

blender --background --python scripts/displacement.py -- BASE.e57 LATER.e57 --out displacement.csv
python scripts/displacement.py -- BASE.e57 LATER.e57 --out displacement.csv          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("displacement")
