"""Scan a model with the simulated scanner inside Blender, without a window.

blender --background --python scripts/simulate.py -- MODEL.ifc --stations stations.json --out SCAN.e57
python scripts/simulate.py -- MODEL.ifc --stations stations.json --out SCAN.e57          (with the bpy module)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from headless_entry import run

run("simulate")
