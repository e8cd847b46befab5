"""What a hole in a wall is: by what fills it, what came back through it, and whether its back is solid."""

from __future__ import annotations

import ifcopenshell.util.placement
import numpy as np
import pytest
from shapely import box

from bim_verify.core.reconstruction.building import BuiltRoom, BuiltStorey, BuiltWall, FitRecord, Reconstruction
from bim_verify.core.reconstruction.crossings import Crossings
from bim_verify.core.reconstruction.openings import Opening, face_raster, find_openings
from bim_verify.core.reconstruction.shapes import shapes_of
from bim_verify.core.reconstruction.summary import reconstruction_to_json
from bim_verify.core.reconstruction.thickness import hint, settle
from bim_verify.core.reconstruction.walls import WallLine
from bim_verify.core.reconstruction.write_ifc import building_file

BAND = 0.012
HOLE = (1.0, 2.2, 0.9, 2.1)
DOOR = (1.0, 2.0, 0.0, 2.1)
FRAME_M = 0.06


def side(hole: tuple[float, float, float, float], back: float, frame: float | None = None, lost: float = 0.0) -> Crossings:
    """Rays at right angles to a wall of 4 m by 2.6 m; a ``frame`` stands so deep, a share of the other rays gets ``lost``."""
    u, z = (v.ravel() for v in np.meshgrid(np.arange(0.005, 4.0, 0.01), np.arange(0.005, 2.6, 0.01)))
    rng = np.random.default_rng(1)
    depth = rng.normal(0.0, 0.002, len(u))
    gap = np.min([u - hole[0], hole[1] - u, hole[3] - z, z - hole[2] if hole[2] else np.full(len(z), 9.0)], axis=0)
    depth[gap > 0] += back
    kept = (gap < 0) | (rng.random(len(u)) >= lost)
    if frame is not None:
        rim = (gap > 0) & (gap < FRAME_M)
        depth[rim] += frame - back
        kept |= rim
    u, z, depth = u[kept], z[kept], depth[kept]
    return Crossings(u, z, depth, u, z, np.arange(len(u)))


def found(*sides: Crossings, lost: bool = False) -> list[Opening]:
    return find_openings(face_raster(list(sides), (0.0, 4.0), (0.0, 2.6), BAND), list(sides), 0.0, 0.3, BAND, lost)


@pytest.mark.parametrize(("hole", "back", "frame", "lost", "kind"), [
    (HOLE, 3.0, None, 0.0, "opening"), (HOLE, 3.0, 0.08, 0.0, "window"), (HOLE, 3.0, None, 0.6, "window"),
    (HOLE, 0.12, 0.09, 0.0, "window"), (DOOR, 3.0, None, 0.0, "opening"), (DOOR, 0.1, 0.08, 0.0, "door"),
    (HOLE, 0.2, None, 0.0, "recess"), (DOOR, 0.12, None, 0.0, "recess"),
])  # fmt: skip
def test_a_hole_is_what_fills_it(
    hole: tuple[float, float, float, float], back: float, frame: float | None, lost: float, kind: str
) -> None:
    (opening,) = found(side(hole, back, frame, lost), lost=True)
    assert opening.kind == kind and opening.down == (hole == DOOR)
    assert opening.recess == (pytest.approx(back, abs=0.001) if kind == "recess" else 0.0)
    assert (opening.u0, opening.u1, opening.z0, opening.z1) == pytest.approx(hole, abs=0.012)


def test_rays_lost_behind_a_hole_between_two_rooms_are_no_pane() -> None:
    (opening,) = found(side(HOLE, 3.0, None, 0.6))
    assert opening.kind == "opening" and opening.lost > 0.5


@pytest.mark.parametrize("depth", [0.02, 0.03, 0.04])
def test_bare_wall_beside_a_lining_is_no_opening(depth: float) -> None:
    assert found(side((1.0, 3.0, 0.0, 2.6), depth)) == []


def test_a_closed_leaf_that_both_sides_see_is_a_door() -> None:
    (opening,) = found(side(DOOR, 0.03), side(DOOR, 0.05))
    assert opening.kind == "door"


def test_a_closed_leaf_that_one_side_sees_is_a_door() -> None:
    """Set back by as little as a lining is thick, but of a leaf's size, and with wall over it."""
    (opening,) = found(side(DOOR, 0.028))
    assert opening.kind == "door" and opening.recess == 0.0
    assert hint(side(DOOR, 0.028), [opening], BAND).leaf == pytest.approx(0.028, abs=0.002)
    assert found(side((1.0, 3.5, 0.0, 2.1), 0.028)) == []


def test_a_wall_goes_on_behind_its_recess_and_learns_no_thickness_from_it() -> None:
    (opening,) = found(side(HOLE, 0.4))
    told = hint(side(HOLE, 0.4), [opening], BAND)
    assert told.reveal is None and told.leaf is None and told.recess == pytest.approx(0.4, abs=0.001)
    line = WallLine(np.array([1.0, 0.0]), 0.0, 0.0, "ASSUMED", 0.0, 5.0)
    settle([line], [told])
    assert line.thickness > 0.44 and line.source == "ASSUMED"


def test_a_recess_is_written_as_deep_as_it_was_seen() -> None:
    opening = Opening(*HOLE, "recess", True, 1.0, recess=0.2)
    fit = FitRecord(None, None, 1.0, None, "ASSUMED")
    wall = BuiltWall(
        np.zeros(2), np.array([4.0, 0.0]), 0.3, box(0, -0.15, 4, 0.15), 0.0, 2.6, (opening,), (None, None), (0,), None, fit
    )
    room = BuiltRoom(box(0.0, 0.15, 4.0, 3.0), 0.0, 2.6)
    whole = Reconstruction(np.zeros(3), (BuiltStorey("Storey", 0.0, 2.6, (wall,), (), (), (room,)),), 1, 1, ("room.e57",))
    file = building_file(whole)
    (hole,) = file.by_type("IfcOpeningElement")
    assert hole.PredefinedType == "RECESS" and not file.by_type("IfcWindow")
    back = ifcopenshell.util.placement.get_local_placement(hole.ObjectPlacement)[1, 3]
    assert back == pytest.approx(0.15 - 0.2)
    (shape,) = shapes_of(file)["openings"]
    assert (shape.length, shape.height) == pytest.approx((1.2, 1.2))
    (told,) = reconstruction_to_json(whole)["storeys"][0]["walls"][0]["openings"]
    assert told["kind"] == "recess" and told["recess_depth"] == 0.2
