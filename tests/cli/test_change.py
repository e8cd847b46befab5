"""``bim-verify change`` as users run it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

from bim_verify.core.model.load import load_model
from bim_verify.core.simulation.campaign import Campaign, set_up, write_campaign
from bim_verify.core.simulation.scene import Prop

from ..core.templates import check_templates
from .test_cli import SCANNER, STAND, data, left, place, run, says_one_sentence  # noqa: F401

PROPERTIES = {
    "State", "ConfirmedRatio", "DisappearedRatio", "NewRatio", "UnknownRatio", "DisappearedVolume", "BuiltVolume",
    "ExpectedState", "VoxelSize", "Epoch", "ReferenceEpoch",
}  # fmt: skip


def test_change_writes_everything_that_was_asked_for(data: Path, place: Path) -> None:  # noqa: F811
    before = (data / "model.ifc").read_bytes()
    done = run(
        place, "change", data / "model.ifc", "--epoch", data / "scan.e57", "--reference", data / "scan.e57", "--out",
        "changed.ifc", "--voxel-mm", 50, "--voxels", "voxels.ply", "--report", "report", "--json", "change.json", "--quiet",
        "--origin", "other.xyz=1,2,3",
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


def test_an_epoch_in_another_frame_is_brought_to_the_model(data: Path, place: Path) -> None:  # noqa: F811
    model = load_model(data / "model.ifc", cache=False, threads=1)
    off = dataclasses.replace(model, origin=model.origin + np.array([0.09, -0.07, 0.03]))
    stands = (STAND, STAND + np.array([0.9, 0.5, 0.0]))
    set_ups = tuple(set_up(f"S{k}", stand - model.origin, 1, k) for k, stand in enumerate(stands))
    write_campaign(Campaign(off, SCANNER, set_ups, {}, (), 1), data / "near")
    given = ("change", data / "model.ifc", "--epoch", data / "near" / "scan.e57", "--voxel-mm", 50, "--quiet", "--out", "c.ifc")
    aligned = run(place, *given, "--align", "fine", "--json", "c.json")
    assert aligned.returncode == 0 and "Alignment of the epoch (fine)" in aligned.stdout, aligned.stderr
    record = json.loads((place / "c.json").read_text())["epochs"][0]["alignment"]
    assert [row[3] for row in record["transform"][:3]] == pytest.approx([-0.09, 0.07, -0.03], abs=0.005)


@pytest.fixture(scope="module")
def half_south(data: Path) -> Path:  # noqa: F811
    """A scan of the model with the east half of its south wall demolished, before a screen that beams end at."""
    file = ifcopenshell.open(str(data / "model.ifc"))
    profile = next(
        item.SweptArea
        for wall in file.by_type("IfcWall") if wall.Name == "South"
        for shape in wall.Representation.Representations for item in shape.Items
    )
    profile.XDim = 2000.0
    profile.Position.Location.Coordinates = (1000.0, 100.0)
    (folder := data / "half").mkdir()
    file.write(str(folder / "half.ifc"))
    model = load_model(folder / "half.ifc", cache=False, threads=1)
    screen = Prop("screen", "box", tuple((np.array([2.0, -1.0, 1.25]) - model.origin).tolist()), (8.0, 0.1, 6.0))
    write_campaign(Campaign(model, SCANNER, (set_up("S", STAND - model.origin, 1, 0),), {}, (screen,), 1), folder)
    return folder / "scan.e57"


def test_what_is_left_of_a_demolished_wall_is_written(data: Path, half_south: Path, place: Path) -> None:  # noqa: F811
    left_over = place / "out" / "left"
    done = run(
        place, "change", data / "model.ifc", "--epoch", half_south, "--out", "changed.ifc", "--voxel-mm", 50, "--json",
        "change.json", "--remaining", left_over, "--quiet",
    )
    assert done.returncode == 0, done.stderr
    assert f"Remaining shapes: {left_over / 'remaining.csv'}" in done.stdout
    found = json.loads((place / "change.json").read_text())
    row = [c["name"] for c in found["changes"]].index("South")
    assert found["changes"][row]["state"] == "PARTIAL"
    path, table = sorted(left_over.iterdir())
    assert table.name == "remaining.csv" and path.name in table.read_text("utf-8-sig")
    assert path.name == f"{found['elements'][row]}.obj"
    lines = [line.split() for line in path.read_text().splitlines()]
    vertices = np.array([line[1:] for line in lines if line[0] == "v"], dtype=np.float64)
    faces = np.array([line[1:] for line in lines if line[0] == "f"], dtype=np.int64) - 1
    assert np.allclose(vertices.min(axis=0), [0.0, 0.0, 0.0], atol=0.06)
    assert np.allclose(vertices.max(axis=0), [2.0, 0.2, 2.5], atol=0.11)
    corner = vertices[faces]
    cross = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]) / 2
    assert np.einsum("ij,ij->", corner.mean(axis=1), cross) / 3 == pytest.approx(1.0, rel=0.15)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--epoch", "missing.e57"), ("missing.e57",)),
        (("--epoch", "{scan}", "--voxel-mm", "0"), ("--voxel-mm",)),
        (("--epoch", "{scan}", "--min-points", "0"), ("--min-points",)),
        (("--epoch", "{scan}", "--date", "yesterday"), ("--date",)),
        (("--epoch", "{scan}", "--voxels", "{scan}"), ("never written",)),
        (("--epoch", "{scan}", "--origin", "1,2,3", "--origin", "4,5,6"), ("--origin", "FILE=X,Y,Z")),
    ],
)
def test_bad_input_is_said_in_one_sentence(
    arguments: tuple[str, ...], words: tuple[str, ...], data: Path, place: Path  # noqa: F811
) -> None:
    given = [a.format(scan=data / "scan.e57") for a in arguments]
    done = run(place, "change", data / "model.ifc", *given, "--out", "changed.ifc", "--quiet")
    says_one_sentence(done, 1, *words)
    assert left(place) == []
