"""Against Bonsai itself, where it can be imported; ``test_bonsai.py`` runs everywhere, against a stand-in."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import pytest

pytestmark = pytest.mark.skipif(importlib.util.find_spec("bonsai") is None, reason="Bonsai is not installed")
LONGEST_S = 600
MODULE = "bim_verify.tests.addon.bonsai_round_trip"


def test_load_verify_decide_and_save_in_bonsai(house: Path, scan: Path, tmp_path: Path) -> None:
    out = tmp_path / "saved.ifc"
    arguments = [sys.executable, "-m", MODULE, str(house), str(scan), str(out)]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "resources")}
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    said = json.loads(done.stdout.strip().splitlines()[-1])
    assert said["meshes_kept"] and said["stand_for"] == said["elements"] == len(said["statuses"]) == 5
    saved = ifcopenshell.open(str(out))
    for global_id, status in said["statuses"].items():
        psets = ifcopenshell.util.element.get_psets(saved.by_guid(global_id))
        assert psets["BimVerify_Verification"]["Status"] == status
    decided = ifcopenshell.util.element.get_psets(saved.by_guid(said["decided"]))["BimVerify_Decision"]
    assert (decided["Status"], decided["Reason"]) == ("CONFIRMED", "seen")
