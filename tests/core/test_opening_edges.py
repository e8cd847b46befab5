"""Edges of a hole in a wall: seen, behind furniture, or seen by the reveal."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from shapely import box

from bim_verify.core.planes.fit import fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.reconstruction.building import (
    BuiltRoom,
    BuiltStorey,
    BuiltWall,
    FitRecord,
    FittedFace,
    Reconstruction,
    RoomFace,
)
from bim_verify.core.reconstruction.crossings import Crossings
from bim_verify.core.reconstruction.dimensions import room_dimensions
from bim_verify.core.reconstruction.opening_edges import gathered, hidden_edge, reveal_between, reveal_edge, seen_edge
from bim_verify.core.reconstruction.opening_fill import reveal_depth
from bim_verify.core.reconstruction.openings import Opening, face_raster, find_openings
from bim_verify.core.reconstruction.report import write_reconstruction_report
from bim_verify.core.reconstruction.summary import reconstruction_to_json
from bim_verify.core.reconstruction.thickness import Hint, hint, settle
from bim_verify.core.reconstruction.walls import WallLine

BAND = 0.012
HOLE = (1.0, 2.2, 0.9, 2.1)


def rays(hidden: tuple[float, float, float, float] | None, hole: tuple[float, float, float, float]) -> Crossings:
    """Rays at right angles to a wall of 4 m by 2.6 m with a hole; what hides stands 0.5 m before it."""
    u, z = (v.ravel() for v in np.meshgrid(np.arange(0.005, 4.0, 0.01), np.arange(0.005, 2.6, 0.01)))
    depth = np.random.default_rng(1).normal(0.0, 0.002, len(u))
    depth[(u > hole[0]) & (u < hole[1]) & (z > hole[2]) & (z < hole[3])] = 3.0
    if hidden is not None:
        depth[(u > hidden[0]) & (u < hidden[1]) & (z > hidden[2]) & (z < hidden[3])] = -0.5
    return Crossings(u, z, depth, u, z, np.arange(len(u)))


def found(hidden: tuple[float, float, float, float] | None, hole: tuple[float, float, float, float] = HOLE) -> Opening:
    side = rays(hidden, hole)
    openings = find_openings(face_raster([side], (0.0, 4.0), (0.0, 2.6), BAND), [side], 0.0, 0.3, BAND, False)
    assert len(openings) == 1
    return openings[0]


def test_edges_in_view_are_placed_to_millimetres() -> None:
    opening = found(None)
    assert opening.hidden == ()
    assert (opening.u0, opening.u1, opening.z0, opening.z1) == pytest.approx(HOLE, abs=0.006)
    assert max(opening.edge_sigma) < 0.005


def test_an_edge_seen_only_above_a_cupboard_is_followed_there() -> None:
    opening = found((1.5, 2.6, 0.0, 2.0))
    assert "end" not in opening.hidden
    assert opening.u1 == pytest.approx(HOLE[1], abs=0.01)


def test_a_hidden_edge_is_said_to_be_and_its_sigma_covers_where_it_may_be() -> None:
    opening = found((1.5, 3.0, 0.0, 2.6))
    assert opening.hidden == ("end",)
    assert opening.edge_sigma[1] == pytest.approx(1.5 / np.sqrt(12), rel=0.1)
    assert abs(opening.u1 - HOLE[1]) < 2 * opening.edge_sigma[1]


@pytest.mark.parametrize(("columns", "end"), [
    ((0.155, 0.235), (0.235, 0.325)), ((0.155, 0.185, 0.235), (0.235, 0.29)),
    ((0.24, 0.25, 0.26), (0.26, 0.264)), ((0.235,), (0.235, 0.245)),
])
def test_a_reveal_ends_between_the_last_column_of_returns_and_where_the_next_would_lie(
    columns: tuple[float, ...], end: tuple[float, float]
) -> None:
    rng = np.random.default_rng(6)
    before = np.repeat(np.arange(0.02, 0.12, 0.01) + 0.005, 20)
    depth = np.concatenate([before, np.repeat(columns, 12) + rng.normal(0.0, 0.0005, 12 * len(columns))])
    z = np.tile(np.linspace(1.0, 2.0, 4), len(depth) // 4 + 1)[: len(depth)]
    u = np.full(len(depth), 1.05)
    pane = rng.uniform(1.2, 2.0, 400), rng.uniform(1.05, 1.95, 400)
    side = Crossings(
        np.concatenate([u, pane[0]]), np.concatenate([z, pane[1]]), np.concatenate([depth, np.full(400, 0.12)]),
        np.concatenate([np.full(len(depth), 1.002), pane[0]]), np.concatenate([z, pane[1]]), np.arange(len(depth) + 400),
    )  # fmt: skip
    span, leaf = reveal_depth(side, (1.0, 2.2, 0.9, 2.1), BAND)
    assert span is not None and leaf == pytest.approx(0.12, abs=0.001)
    assert span == pytest.approx(end, abs=0.011)
    assert span[0] <= max(columns) + 0.002


@pytest.mark.parametrize("framed", [True, False])
def test_a_reveal_that_ends_at_a_frame_without_a_pane_is_no_thickness(framed: bool) -> None:
    rng = np.random.default_rng(8)
    count = 400
    depth, z = rng.uniform(0.013, 0.07, count), rng.uniform(0.95, 2.05, count)
    frame_u, frame_z = rng.uniform(1.0, 1.06, count), rng.uniform(0.95, 2.05, count)
    seen = slice(0, count if framed else 0)
    end_u, end_z = np.concatenate([np.full(count, 1.001), frame_u[seen]]), np.concatenate([z, frame_z[seen]])
    deep = np.concatenate([depth, np.full(count, 0.07)[seen]])
    side = Crossings(end_u + 0.05, end_z, deep, end_u, end_z, np.arange(len(deep)))
    box = (1.0, 2.2, 0.9, 2.1)
    window = Opening(*box, "window", framed, 1.0)
    found = hint(side, [window], BAND)
    assert (found.reveal is None) == framed
    assert found.at_least == pytest.approx(0.07, abs=0.005)
    assert found.leaf == (pytest.approx(0.07, abs=0.005) if framed else None)


def test_outer_walls_are_as_thick_as_all_their_reveals_allow() -> None:
    def walls(*spans: tuple[float, float] | None) -> list[WallLine]:
        lines = [WallLine(np.array([1.0, 0.0]), 0.0, 0.0, "ASSUMED", 0.0, 5.0) for _ in spans]
        settle(lines, [Hint(s, 0.1, 0.12) for s in spans])
        return lines

    same = walls((0.246, 0.326), (0.235, 0.275), None)
    assert [w.source for w in same] == ["REVEAL", "REVEAL", "ASSUMED"]
    assert [w.thickness for w in same] == pytest.approx([0.2605] * 3)
    assert same[0].thickness_sigma < 0.012 < same[2].thickness_sigma
    near = walls((0.424, 0.623), (0.400, 0.413), (0.398, 0.588))
    assert [w.thickness for w in near] == pytest.approx([0.4185] * 3)
    assert near[0].thickness_sigma == pytest.approx(np.hypot(0.005, 0.011 / np.sqrt(12.0)))
    apart = walls((0.40, 0.40), (0.42, 0.42))
    assert [w.thickness for w in apart] != pytest.approx([0.41] * 2)
    other = walls((0.24, 0.24), (0.40, 0.41))
    assert other[1].thickness == pytest.approx(0.405) and other[1].source == "REVEAL"


DOOR = (1.0, 2.0, 0.0, 2.1)
WINDOW = (1.0, 2.2, 0.4, 2.1)


@pytest.mark.parametrize("hole", [DOOR, WINDOW])
def test_a_hole_whose_foot_is_hidden_is_neither_door_nor_window(hole: tuple[float, float, float, float]) -> None:
    opening = found((0.5, 3.0, 0.0, 0.8), hole)
    assert opening.kind == "opening" and opening.foot_hidden
    assert opening.hidden == ("sill",)
    assert abs(opening.z0 - hole[2]) <= 2 * opening.edge_sigma[2]
    assert opening.z1 == pytest.approx(hole[3], abs=0.01)


def test_wall_seen_below_a_hidden_sill_says_no_door() -> None:
    opening = found((0.5, 3.0, 0.25, 0.8), WINDOW)
    assert opening.kind == "opening" and not opening.foot_hidden
    assert opening.hidden == ("sill",)
    assert opening.z0 - 2 * opening.edge_sigma[2] < WINDOW[2] < opening.z0 + 2 * opening.edge_sigma[2]


@pytest.mark.parametrize("hidden", [(0.5, 3.0, 0.3, 0.8), (1.3, 3.0, 0.0, 0.8)])
def test_a_hole_seen_down_to_the_floor_beside_or_below_what_hides_it_is_not_in_doubt(
    hidden: tuple[float, float, float, float],
) -> None:
    opening = found(hidden, DOOR)
    assert not opening.foot_hidden and "sill" not in opening.hidden
    assert opening.z0 == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("before_face", [0.0, 0.005, 0.01, 0.02])
def test_the_end_of_a_leaf_that_stands_open_is_no_wall(before_face: float) -> None:
    """4 cm of leaf, 5 cm beside the edge of its hole: a frame behind the face is seen between the two."""
    side = rays(None, DOOR)
    leaf = (side.u > DOOR[0] + 0.05) & (side.u < DOOR[0] + 0.09) & (side.z > 0.01) & (side.z < DOOR[3] - 0.05)
    side.depth[leaf] = np.random.default_rng(2).normal(-before_face, 0.002, int(leaf.sum()))
    openings = find_openings(face_raster([side], (0.0, 4.0), (0.0, 2.6), BAND), [side], 0.0, 0.12, BAND, False)
    assert [o.hidden for o in openings] == [()]
    assert (openings[0].u0, openings[0].u1) == pytest.approx(DOOR[:2], abs=0.01)


def test_a_leaf_before_the_face_and_within_its_band_is_not_the_edge_where_the_other_side_sees_through() -> None:
    """The leaf hides the frame beside it, and a little of the reveal is seen; its end lies 1 cm before the face."""
    near, far = rays(None, DOOR), rays(None, DOOR)
    hidden = (near.u > DOOR[0] + 0.012) & (near.u < DOOR[0] + 0.05) & (near.z < DOOR[3])
    leaf = (near.u > DOOR[0] + 0.05) & (near.u < DOOR[0] + 0.09) & (near.z > 0.01) & (near.z < DOOR[3] - 0.05)
    near.depth[hidden] = -0.5
    near.depth[(near.u > DOOR[0]) & (near.u < DOOR[0] + 0.012) & (near.z < DOOR[3])] = 0.008
    near.depth[leaf] = np.random.default_rng(2).normal(-0.01, 0.002, int(leaf.sum()))
    openings = find_openings(face_raster([near, far], (0.0, 4.0), (0.0, 2.6), BAND), [near, far], 0.0, 0.12, BAND, False)
    assert [(o.u0, o.u1) for o in openings] == [pytest.approx(DOOR[:2], abs=0.012)]


@pytest.mark.parametrize("visible", [True, False])
def test_edges_hold_within_their_sigma_with_a_coarse_grid(visible: bool) -> None:
    """Columns of rays 15 mm apart, alike in all strips: only a reveal, where it is seen, tells more than the gap."""
    rng = np.random.default_rng(7)
    off = []
    for _ in range(60):
        edge = 1.0 + rng.uniform(0.0, 0.015)
        u, z = (v.ravel() for v in np.meshgrid(np.arange(0.5, 1.5, 0.015), np.arange(0.0, 2.0, 0.015)))
        depth, end = np.where(u < edge, rng.normal(0.0, 0.002, len(u)), 3.0), u.copy()
        if visible:
            on = (u > edge) & (u < edge + 0.06)
            depth[on], end[on] = 2.0 * (u[on] - edge), edge + rng.normal(0.0, 0.001, int(on.sum()))
        at = np.where(np.abs(depth) <= BAND, end, u)
        place = seen_edge(
            at, z, depth, np.ones(len(u), dtype=np.bool_), edge + 0.02, edge - 0.02, 0.02, 1.0, BAND,
            partial(reveal_between, end, z, depth, depth > 0.5 * BAND),
        )
        assert place is not None and place.sigma < (0.0015 if visible else 0.006)
        off.append(abs(place.at - edge) < 1.96 * place.sigma)
    assert np.mean(off) > 0.9


@pytest.mark.parametrize("reveal_returns", [0, 200])
def test_a_row_of_rays_on_a_frame_beside_the_reveal_is_not_the_edge(reveal_returns: int) -> None:
    """The frame stands 9 cm deep; its lowest row of returns lies 5 mm within the edge, at 1 m."""
    rng = np.random.default_rng(5)
    row, reveal = 300, reveal_returns
    end = np.concatenate([np.full(row, 1.005), np.full(reveal, 1.0)]) + rng.normal(0.0, 0.0005, row + reveal)
    depth = np.concatenate([rng.normal(0.09, 0.002, row), rng.uniform(0.012, 0.09, reveal)])
    z = rng.uniform(0.0, 2.0, row + reveal)
    place = reveal_between(end, z, depth, np.ones(row + reveal, dtype=np.bool_), 0.99, 1.01)
    if reveal:
        assert place is not None and place.at == pytest.approx(1.0, abs=0.001)
    else:
        assert place is None


def test_an_edge_is_as_likely_at_the_end_of_its_gap_as_in_the_middle() -> None:
    """Columns of rays that are alike in 20 strips bound the edge once, not 20 times."""
    held = []
    for share in np.linspace(0.0, 1.0, 21):
        rng = np.random.default_rng(int(100 * share))
        edge = 1.0 + 0.02 * share
        u, z = (v.ravel() for v in np.meshgrid(np.arange(0.88, 1.15, 0.02), np.arange(0.0, 0.8, 0.01)))
        depth = np.where(u < edge, 0.0, 3.0)
        at = u + np.where(u < edge, rng.normal(0.0, 0.001, len(u)), 0.0)
        place = seen_edge(at, z, depth, np.ones(len(u), dtype=np.bool_), edge, edge, 0.02, -1.0, BAND, lambda *_: None)
        assert place is None  # the hole lies on the other side
        place = seen_edge(-at, z, depth, np.ones(len(u), dtype=np.bool_), -edge, -edge, 0.02, -1.0, BAND, lambda *_: None)
        assert place is not None and place.sigma == pytest.approx(0.02 / np.sqrt(12), rel=0.2)
        held.append(abs(place.at + edge) < 1.96 * place.sigma)
    assert np.mean(held) > 0.9


def test_a_face_that_a_station_sees_too_deep_is_not_taken_for_the_reveal() -> None:
    """The station is 6 mm off; its columns are 35 mm apart and alike in all strips, so the edge lies anywhere between two."""
    rng = np.random.default_rng(9)
    u, z = (v.ravel() for v in np.meshgrid(np.arange(0.88, 1.15, 0.035), np.arange(0.0, 0.8, 0.01)))
    edge = 1.01
    depth = np.where(u < edge, rng.normal(0.006, 0.001, len(u)), 3.0)
    place = seen_edge(u, z, depth, np.ones(len(u), dtype=np.bool_), edge, edge, 0.03, 1.0, BAND, lambda *_: None)
    assert place is not None and place.sigma == pytest.approx(0.035 / np.sqrt(12), rel=0.2)
    assert abs(place.at - edge) < 1.96 * place.sigma


@pytest.mark.parametrize("within", [0.012, 0.028])
def test_beams_on_an_edge_and_the_frame_behind_it_are_no_face(within: float) -> None:
    """One station's column returns from 8 mm behind the face; the other one sees the frame nearer to the edge."""
    rng = np.random.default_rng(11)
    edge = 1.0
    u, z = (v.ravel() for v in np.meshgrid(np.arange(0.855, 1.15, 0.01), np.arange(0.0, 2.0, 0.01)))
    depth = np.where(u < edge, rng.normal(0.0, 0.002, len(u)), 0.036)
    column = np.arange(0.0, 2.0, 0.014)
    u, z = np.append(u, np.full(len(column), edge + within)), np.append(z, column)
    depth = np.append(depth, rng.normal(0.008, 0.0005, len(column)))
    place = seen_edge(u, z, depth, np.ones(len(u), dtype=np.bool_), edge, edge, 0.02, 1.0, BAND, lambda *_: None)
    assert place is not None and place.at == pytest.approx(edge, abs=0.006)
    assert abs(place.at - edge) < 1.96 * place.sigma


def test_a_return_on_a_moved_face_is_where_it_is() -> None:
    """The ray was followed to the face where that was looked for first; the return lies on the face that was found."""
    side = Crossings(np.array([1.02, 1.5]), np.array([1.0, 1.2]), np.array([0.005, 2.0]), np.array([1.0, 1.9]),
                     np.array([1.0, 1.1]), np.arange(2))  # fmt: skip
    rays = gathered([side], BAND)
    assert rays.u == pytest.approx([1.0, 1.5]) and rays.z == pytest.approx([1.0, 1.2])


def test_an_edge_behind_which_the_wall_is_open_again_may_lie_as_far_as_wall_is_seen() -> None:
    place = hidden_edge(1.0, 1.4, 2.4, 0.02)
    assert place.at == pytest.approx(1.2) and not place.seen
    assert place.sigma > 0.5
    assert hidden_edge(1.0, 0.6, 0.6, 0.0).sigma == pytest.approx(0.4 / np.sqrt(12))


def test_an_open_leaf_is_no_reveal() -> None:
    rng = np.random.default_rng(3)
    z, noise = rng.uniform(0.0, 2.0, 400), rng.normal(0.0, 0.002, 400)
    inside = np.ones(400, dtype=np.bool_)
    for begin, expected in ((0.013, 1.0), (0.05, None)):
        place = reveal_edge(1.0 + noise, z, rng.uniform(begin, 0.2, 400), inside, (0.9, 1.3), 0.24)
        assert (place is None) == (expected is None)
        if place is not None and expected is not None:
            assert place.seen
            assert place.at == pytest.approx(expected, abs=0.002)


def test_widths_and_right_angles_of_a_room_with_their_uncertainty(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    station, size = np.array([2.0, 1.5, 1.5]), (4.0, 3.0, 2.5)
    noise = PointNoise(0.003, 0.0, 1e-9)
    walls, faces = [], []
    for axis, at in ((0, 0.0), (0, 4.0), (1, 0.0), (1, 3.0)):
        points = rng.random((400, 3)) * size
        points[:, axis] = at
        if (axis, at) == (1, 3.0):
            points[:, 1] += 0.02 * points[:, 0] / 4.0  # out of parallel by 20 mm over 4 m
        ray = points - station
        points += ray / np.linalg.norm(ray, axis=1, keepdims=True) * rng.normal(0.0, 0.003, (400, 1))
        plane = fit_plane(points, station, noise).facing(station)
        fit = FitRecord(None, None, 1.0, None, "ASSUMED")
        faces.append(RoomFace(len(walls), FittedFace(plane), (points[:, :2].min(axis=0), points[:, :2].max(axis=0))))
        walls.append(BuiltWall(
            np.zeros(2), np.ones(2), 0.2, box(0, 0, 1, 1), 0.0, 2.5, (), (None, None), (0,), True, fit,
            faces=(FittedFace(plane),),
        ))  # fmt: skip
    room = BuiltRoom(box(0.0, 0.0, 4.0, 3.01), 0.0, 2.5, wall_faces=tuple(faces))
    storey = BuiltStorey("Storey", 0.0, 2.5, tuple(walls), (), (), (room,))
    result = room_dimensions(room)
    (width,) = (w for w in result.widths if w.walls == (0, 1))
    assert abs(width.distance.value - 4.0) < 3 * width.distance.sigma < 0.003
    by_name = {(t.name, at): t for at, t in result.tests}
    off = by_name["parallelism", (2, 3)]
    assert off.p_value < 1e-3
    assert off.exceeds and abs(off.value - 0.02) < 3 * off.sigma + 0.001
    assert not by_name["plumb", (0,)].exceeds
    assert not by_name["orthogonality", (0, 2)].exceeds
    whole = Reconstruction(np.zeros(3), (storey,), 1600, 1, ("room.e57",))
    page = write_reconstruction_report(tmp_path / "report", whole, None).read_text(encoding="utf-8")
    assert "parallelism" in page and "exceeded" in page
    (told,) = reconstruction_to_json(whole)["storeys"][0]["rooms"]
    assert len(told["widths"]) == 2
    low, high = told["widths"][0]["interval_95"]
    assert low < told["widths"][0]["width"] < high
