"""Elements of which a part stands: in the reference, now, or in both."""

from __future__ import annotations

import base64
import csv
import dataclasses
import io
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from bim_verify.core.change.amounts import Amount
from bim_verify.core.change.decide import element_state, ratios
from bim_verify.core.change.look import ElementSight, Seen
from bim_verify.core.files import all_or_none
from bim_verify.core.jobs import change
from bim_verify.core.options import ChangeOptions
from bim_verify.core.report.change_page import render_change_page
from bim_verify.core.report.remaining import remaining_mesh, remaining_volume, write_remaining
from bim_verify.core.report.remaining_view import remaining_views
from bim_verify.core.simulation.scene import Prop

from .verify_data import PLAN, built, house, scan

OPTIONS = ChangeOptions(voxel=0.04, sigma=0.0013, sample_spacing=0.1, memory_gb=1.0)
ROW = list(PLAN).index("partition")
SECTION_M2 = 0.2 * 3.0
"""Of the partition, 4 m long."""


@cache
def standing(length: float) -> Any:
    """A scan in which so many metres of the partition stand."""
    return scan(built({}, (), {"partition": (((6.0, 0.0, 0.0), (6.2, length, 3.0)),)}), seed=round(10 * length))


def mesh_volume(vertices: np.ndarray, quads: np.ndarray) -> float:
    corner = vertices[quads]
    cross = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]) / 2
    return float(np.einsum("ij,ij->i", corner.mean(axis=1), cross).sum() / 3)


@pytest.mark.parametrize(
    "then, now, state", [(1.4, 1.5, "CONFIRMED"), (2.8, 1.4, "PARTIAL"), (1.4, 4.0, "PARTIAL")],
    ids=["as it was", "less", "completed"],
)
def test_volumes_between_epochs_of_a_wall_that_stood_in_part(then: float, now: float, state: str) -> None:
    result = change(house(), [standing(now)], standing(then), OPTIONS)
    found = result.elements[ROW]
    assert found.state == state, found.reason
    volume = SECTION_M2 * 4.0
    assert found.built_volume == pytest.approx(SECTION_M2 * now, rel=0.1)
    assert found.disappeared_volume == pytest.approx(SECTION_M2 * max(then - now, 0.0), abs=0.03 * volume)
    assert found.new_ratio == pytest.approx(max(now - then, 0.0) / 4.0, abs=0.05)
    assert found.confirmed_ratio == pytest.approx(min(then, now) / 4.0, abs=0.05)
    assert found.confirmed_ratio + found.new_ratio + found.disappeared_ratio + found.unknown_ratio == pytest.approx(1.0)
    assert mesh_volume(*remaining_mesh(result, ROW)) == pytest.approx(SECTION_M2 * now, rel=0.05)
    assert remaining_volume(result, ROW) == pytest.approx(SECTION_M2 * now, rel=0.05)
    assert found.agrees == (now == 4.0) and (ROW in result.remaining) == (now < 4.0)
    percent = next(g.complete for g in result.groups if g.kind == "class" and g.name == "IfcWall")
    assert percent is not None and (percent == 1.0) == (now == 4.0)


def test_how_much_of_a_wall_stands_is_told_from_one_side_too() -> None:
    """Beams that pass tell of all its thickness, those that return of one face only: volumes would say 0.26."""
    fence = Prop("fence", "box", (6.0, -1.5, 1.5), (16.0, 0.1, 8.0))
    seen = scan(built({}, (fence,), {"south": (((0.0, -0.2, 0.0), (6.1, 0.0, 3.0)),)}), seed=4)
    found = change(house(), [seen], None, OPTIONS).elements[list(PLAN).index("south")]
    assert found.state == "PARTIAL" and found.confirmed_ratio < 0.2
    assert found.standing_ratio == pytest.approx(0.5, abs=0.06)


def test_the_table_of_remaining_shapes_states_volumes_that_voxels_do_not_spoil(tmp_path: Path) -> None:
    """Half of a ceiling of 20 mm, in voxels of 40 mm: its mesh is twice as thick."""
    part = {"ceiling": (((0.0, 0.0, 2.7), (3.0, 4.0, 2.72)),)}
    result = change(house(), [scan(built({}, (), part), seed=6)], None, OPTIONS)
    written = write_remaining(tmp_path, result)
    rows = list(csv.DictReader((tmp_path / "remaining.csv").read_text("utf-8-sig").splitlines()))
    assert [r["File"] for r in rows] == [path.name for path in written]
    ceiling = next(r for r in rows if r["Name"] == "ceiling")
    assert float(ceiling["Planned_m3"]) == pytest.approx(0.48)
    assert float(ceiling["Remaining_m3"]) == pytest.approx(0.24, abs=0.03)


def test_a_thin_ceiling_of_which_less_than_half_is_gone_stands_in_part() -> None:
    """Its 20 mm are less than a voxel, so voxels alone do not tell this from edges."""
    part = {"ceiling": (((2.4, 0.0, 2.7), (6.0, 4.0, 2.72)),)}
    result = change(house(), [scan(built({}, (), part), seed=7)], None, OPTIONS)
    found = {e.name: e for e in result.elements}
    ceiling = found.pop("ceiling")
    assert ceiling.state == "PARTIAL" and ceiling.agrees is False, ceiling.reason
    assert ceiling.disappeared_ratio == pytest.approx(0.4, abs=0.06)
    assert {e.state for e in found.values()} <= {"CONFIRMED", "UNKNOWN"}


def sight(seen: Seen, at: float = 10.0, beyond: float = 0.0, shift: tuple[float, float, float] | None = None) -> ElementSight:
    return ElementSight(seen, at, beyond, 10.0, shift, "")


def state(
    now: ElementSight, before: ElementSight, amount: Amount | None = None
) -> tuple[str, tuple[float, float, float, float]]:
    amount = amount or Amount()
    found = element_state(house(), ROW, now, before, amount, 0.01)
    return found.state, ratios(found, amount, now, before)


def test_what_was_absent_and_now_stands_off_its_place_is_not_new() -> None:
    gone, far, near = sight("GONE", 0.0), sight("MOVED", shift=(0.4, 0.0, 0.0)), sight("MOVED", shift=(0.05, 0.0, 0.0))
    assert state(far, gone) == ("UNKNOWN", (0.0, 0.0, 0.0, 1.0))
    assert "400 mm off" in element_state(house(), ROW, far, gone, Amount(), 0.01).reason
    assert state(near, gone) == ("PARTIAL", pytest.approx((0.0, 0.0, 0.75, 0.25)))
    assert state(sight("STANDS"), gone) == ("NEW", (0.0, 0.0, 1.0, 0.0))


def test_a_slender_thing_within_what_model_and_registration_explain_is_left_open() -> None:
    """Of a bar 10 mm wide a tenth overlaps when it is 9 mm off, and voxels of 10 mm do not tell that from its place."""
    there = sight("STANDS", shift=(0.0, 0.0, 0.0))
    for shift, placed, found in ((0.25, 0.26, "UNKNOWN"), (0.25, 0.016, "DISAPPEARED"), (0.05, 0.26, "PARTIAL")):
        moved = dataclasses.replace(sight("MOVED", shift=(shift, 0.0, 0.0)), placed=placed)
        assert element_state(house(), ROW, moved, None, Amount(), 0.01).state == found
        assert element_state(house(), ROW, moved, there, Amount(), 0.01).state == found


@pytest.mark.parametrize("seen", ["STANDS", "GONE", "PART", "UNSEEN"])
def test_nothing_is_said_to_have_stayed_or_come_where_the_reference_saw_it_and_could_not_tell(seen: Seen) -> None:
    """Where the reference did not see it at all, the model takes its place."""
    unseen = sight("UNSEEN", 0.0)
    states = {"STANDS": "CONFIRMED", "GONE": "DISAPPEARED", "PART": "PARTIAL", "UNSEEN": "UNKNOWN"}
    assert state(sight(seen), unseen)[0] == states[seen]
    assert state(sight(seen), dataclasses.replace(unseen, in_doubt=True))[0] == "UNKNOWN"


def test_what_came_back_to_its_place_is_new_where_it_was_not() -> None:
    near = sight("MOVED", shift=(0.05, 0.0, 0.0))
    assert state(sight("STANDS"), near) == ("PARTIAL", pytest.approx((0.75, 0.0, 0.25, 0.0)))
    assert state(near, sight("STANDS")) == ("PARTIAL", pytest.approx((0.75, 0.25, 0.0, 0.0)))


def test_a_part_is_new_only_where_it_was_found() -> None:
    """The gap of the reference is out of view now: nothing shows that the part stands."""
    half = sight("PART", 4.0, 6.0)
    hidden = Amount(absent=0.0, left=0.0, came=0.0, kept=0.4, deep_then=0.6)
    assert state(sight("STANDS", 4.0), half, hidden) == ("CONFIRMED", pytest.approx((0.4, 0.0, 0.0, 0.6)))
    found = Amount(absent=0.0, left=0.0, came=0.6, kept=0.4, deep_then=0.6)
    assert state(sight("STANDS"), half, found) == ("PARTIAL", pytest.approx((0.4, 0.0, 0.6, 0.0)))


def test_a_part_of_what_is_new_is_partial_and_all_of_it_that_stands_is_new() -> None:
    found = state(sight("PART", 4.0, 6.0), sight("GONE", 0.0), Amount(absent=0.6, left=0.1, kept=0.4, deep=0.6))
    assert found == ("PARTIAL", pytest.approx((0.0, 0.0, 0.4, 0.6)))


def test_a_sheet_thinner_than_a_voxel_has_a_remaining_shape(tmp_path: Path) -> None:
    """Half of a ceiling of 20 mm in voxels of 50 mm, none of which has its middle in it."""
    part = {"ceiling": (((0.0, 0.0, 2.7), (3.0, 4.0, 2.72)),)}
    result = change(house(), [scan(built({}, (), part), seed=6)], None, dataclasses.replace(OPTIONS, voxel=0.05))
    row = list(PLAN).index("ceiling")
    assert row in result.remaining and row in result.surfaces
    vertices, quads = remaining_mesh(result, row)
    x, y, _ = vertices[quads].mean(axis=1).T
    gone = (x > 3.2) & (x < 5.7) & (y > 0.3) & (y < 3.7)  # rays spare what touches the walls around, and the column
    assert (x < 3.0).sum() > 1000 and gone.sum() < 0.1 * (x < 3.0).sum()
    assert remaining_volume(result, row) == pytest.approx(0.24, abs=0.03)
    assert tmp_path / f"{result.elements[row].global_id}.obj" in write_remaining(tmp_path, result)


def test_shapes_of_an_earlier_run_are_removed_and_other_files_kept(tmp_path: Path) -> None:
    write_remaining(tmp_path, change(house(), [standing(1.4)], None, OPTIONS))
    old, other = tmp_path / f"{'partition':_<22}.obj", tmp_path / "other.obj"
    other.write_text("v 0 0 0\n")
    assert old.exists()
    now = change(house(), [standing(4.0)], None, OPTIONS)
    with pytest.raises(ZeroDivisionError), all_or_none():
        write_remaining(tmp_path, now)
        _ = 1 / 0
    assert old.exists()
    with all_or_none():
        assert write_remaining(tmp_path, now) == []
    assert not old.exists() and other.exists()


@pytest.mark.parametrize("again", [str.swapcase, str], ids=["other case", "the same"])
def test_shapes_of_elements_that_share_an_id_have_files_of_their_own(again: Callable[[str], str], tmp_path: Path) -> None:
    """Names that differ by case are one file on some systems."""
    parts = {"partition": (((6.0, 0.0, 0.0), (6.2, 1.4, 3.0)),), "ceiling": (((0.0, 0.0, 2.7), (3.0, 4.0, 2.72)),)}
    result = change(house(), [scan(built({}, (), parts), seed=6)], None, OPTIONS)
    ceiling = list(PLAN).index("ceiling")
    elements = list(result.elements)
    elements[ceiling] = dataclasses.replace(elements[ceiling], global_id=again(elements[ROW].global_id))
    with all_or_none():
        written = write_remaining(tmp_path, dataclasses.replace(result, elements=tuple(elements)))
    assert len({path.name.lower() for path in written}) == 2
    rows = list(csv.DictReader((tmp_path / "remaining.csv").read_text("utf-8-sig").splitlines()))
    assert [(r["File"], r["GlobalId"]) for r in rows] == [
        (path.name, elements[row].global_id) for path, row in zip(written, result.remaining, strict=True)
    ]


def test_the_report_shows_what_is_left_of_an_element() -> None:
    result = change(house(), [standing(1.4)], None, OPTIONS)
    (view,) = remaining_views(result)
    assert view.element.name == "partition" and view.side == "from the east (+x)"
    assert view.planned == pytest.approx(2.4) and view.left == pytest.approx(SECTION_M2 * 1.4, rel=0.05)
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(view.image)))).astype(int)
    red, green = (pixels[..., a] > pixels[..., b] for a, b in ((0, 1), (1, 0)))
    assert red.mean() == pytest.approx(2.6 / 4.0, abs=0.05)
    assert green[:, : view.width // 4].all()  # y runs to the right
    page = render_change_page(result)
    assert "Standing in part" in page and view.image in page
