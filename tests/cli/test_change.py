"""``bim-verify change`` as users run it."""

from __future__ import annotations

import json
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import pytest

from ..core.templates import check_templates
from .test_cli import data, left, place, run, says_one_sentence  # noqa: F401

PROPERTIES = {
    "State", "ConfirmedRatio", "DisappearedRatio", "NewRatio", "UnknownRatio", "DisappearedVolume", "BuiltVolume",
    "ExpectedState", "VoxelSize", "Epoch", "ReferenceEpoch",
}  # fmt: skip


def test_change_writes_everything_that_was_asked_for(data: Path, place: Path) -> None:  # noqa: F811
    before = (data / "model.ifc").read_bytes()
    done = run(
        place, "change", data / "model.ifc", "--epoch", data / "scan.e57", "--reference", data / "scan.e57", "--out",
        "changed.ifc", "--voxel-mm", 50, "--voxels", "voxels.ply", "--report", "report", "--json", "change.json", "--quiet",
    )
    assert done.returncode == 0, done.stderr
    assert (data / "model.ifc").read_bytes() == before
    for name in ("voxels.ply", "report/index.html", "report/elements.csv"):
        assert (place / name).stat().st_size > 300
    found = json.loads((place / "change.json").read_text())
    model = ifcopenshell.open(str(place / "changed.ifc"))
    check_templates(model, "BimVerify_Change")
    for guid, change in zip(found["elements"], found["changes"], strict=True):
        properties = ifcopenshell.util.element.get_psets(model.by_guid(guid))["BimVerify_Change"]
        assert set(properties) >= PROPERTIES
        assert properties["State"] == change["state"] in ("CONFIRMED", "UNKNOWN")
        assert properties["VoxelSize"] == pytest.approx(50.0)  # the file is in millimetres
        assert properties["BuiltVolume"] == pytest.approx(change["built_volume"], abs=1e-6)  # and cubic metres


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--epoch", "missing.e57"), ("missing.e57",)),
        (("--epoch", "{scan}", "--voxel-mm", "0"), ("--voxel-mm",)),
        (("--epoch", "{scan}", "--min-points", "0"), ("--min-points",)),
        (("--epoch", "{scan}", "--date", "yesterday"), ("--date",)),
        (("--epoch", "{scan}", "--voxels", "{scan}"), ("never written",)),
    ],
)
def test_bad_input_is_said_in_one_sentence(
    arguments: tuple[str, ...], words: tuple[str, ...], data: Path, place: Path  # noqa: F811
) -> None:
    given = [a.format(scan=data / "scan.e57") for a in arguments]
    done = run(place, "change", data / "model.ifc", *given, "--out", "changed.ifc", "--quiet")
    says_one_sentence(done, 1, *words)
    assert left(place) == []
