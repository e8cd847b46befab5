"""Sides of rooms: under slopes, beside wide windows, below beams."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from shapely import Polygon, contains_xy

from bim_verify.core.reconstruction.faces import Face
from bim_verify.core.reconstruction.levels import Storey
from bim_verify.core.reconstruction.plan import CELL_M, PlanRaster
from bim_verify.core.reconstruction.rooms import Room, find_rooms
from bim_verify.core.reconstruction.storey import ceiling_along
from bim_verify.core.reconstruction.walls import Piece, WallLine

WIDE, DEEP, STEP_M = 4.0, 3.0, 0.05
Heights = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def plan(ceiling: Heights, deep: float = DEEP) -> PlanRaster:
    """One room from 0, 0 to WIDE, ``deep``; ``ceiling`` gives heights over y."""
    low, shape = np.array([-0.6, -0.6]), (90, 75)
    y = low[1] + (np.arange(shape[1]) + 0.5) * CELL_M
    x = low[0] + (np.arange(shape[0]) + 0.5) * CELL_M
    inside = ((x > 0) & (x < WIDE))[:, None] & ((y > 0) & (y < deep))[None]
    heights = np.broadcast_to(ceiling(y), shape).copy()
    return PlanRaster(low, CELL_M, heights, np.where(inside, 0.0, np.nan), inside, inside.astype(np.int32))


def face(normal: tuple[float, float], offset: float, length: float, seen: Callable[..., NDArray[np.bool_]]) -> Face:
    """Surfels every STEP_M where ``seen``(distance from the end, height, x, y) says so."""
    n = np.array(normal)
    along = np.array([n[1], -n[0]])
    first = min(0.0, float(along @ [WIDE, DEEP]))
    u, z = (v.ravel() for v in np.meshgrid(np.arange(first, first + length, STEP_M), np.arange(0.05, 6.0, STEP_M)))
    x, y = (n[:, None] * offset + along[:, None] * u)
    shown = seen(u - first, z, x, y)
    return Face(n, offset, u[shown], z[shown], np.full(int(shown.sum()), STEP_M**2))


def sides(ceiling: Heights, south: Callable[..., NDArray[np.bool_]] | None = None) -> list[Face]:
    """South, east, north, west; all reach the ceiling, but what ``south`` says."""

    def whole(u, z, x, y):  # type: ignore[no-untyped-def]
        return z < ceiling(y)

    return [
        face((0.0, 1.0), 0.0, WIDE, south or whole), face((-1.0, 0.0), -WIDE, DEEP, whole),
        face((0.0, -1.0), -DEEP, WIDE, whole), face((1.0, 0.0), 0.0, DEEP, whole),
    ]


def level(y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.full_like(y, 2.5)


def slope(y: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1.5 + 0.8 * np.clip(y, 0.0, DEEP)


def only_room(raster: PlanRaster, faces: list[Face]) -> Room:
    (room,) = find_rooms(raster, faces, Storey(0.0, 2.5, True, 6.0, (0,)))
    return room


def faces_of(room: Room) -> list[int]:
    return sorted(e.face for e in room.edges)


def test_the_low_wall_under_a_slope_is_a_side_of_its_room() -> None:
    room = only_room(plan(slope), sides(slope))
    assert faces_of(room) == [0, 1, 2, 3]
    assert room.outline.bounds == pytest.approx((0.0, 0.0, WIDE, DEEP))


def test_a_wall_with_a_wide_window_is_a_side_by_its_piers() -> None:
    def glazed(u, z, x, y):  # type: ignore[no-untyped-def]
        return (z < 2.5) & ((u < 0.4) | (u > 3.6) | (z > 2.35))

    assert faces_of(only_room(plan(level), sides(level, glazed))) == [0, 1, 2, 3]


def test_the_side_of_a_beam_is_no_wall() -> None:
    def beam(u, z, x, y):  # type: ignore[no-untyped-def]
        return (z < 2.5) & ((z > 2.25) | (u < 0.4) & (z > 1.9))

    assert faces_of(only_room(plan(level), sides(level, beam))) == [-1, 1, 2, 3]


def test_a_sharp_corner_between_a_slanted_wall_and_another_is_not_cut_off() -> None:
    narrow = 3.04
    outline = Polygon([(0.0, 0.0), (narrow, 0.0), (WIDE, DEEP), (0.0, DEEP)])
    slant = np.array([-DEEP, WIDE - narrow]) / np.hypot(DEEP, WIDE - narrow)
    raster = plan(level)
    ix, iy = np.indices(raster.free.shape).reshape(2, -1)
    # cells that a wall touches are not free
    free = contains_xy(outline.buffer(-1.5 * CELL_M, join_style="mitre"), raster.centres(ix, iy)).reshape(raster.free.shape)
    south, _, north, west = sides(level)

    def east(u, z, x, y):  # type: ignore[no-untyped-def]
        return (z < 2.5) & (y > 0.0) & (y < DEEP)

    faces = [south, face((slant[0], slant[1]), slant[0] * narrow, 5.0, east), north, west]
    room = only_room(replace(raster, free=free, rooms=free.astype(np.int32)), faces)
    assert faces_of(room) == [0, 1, 2, 3]
    assert room.outline.symmetric_difference(outline).area < 1e-3


@pytest.mark.parametrize(("ceiling", "room_level", "expected"), [(slope, 2.7, 1.5), (level, 2.5, 2.5), (level, 2.48, 2.48)])
def test_a_wall_reaches_as_high_as_the_ceiling_along_it(ceiling: Heights, room_level: float, expected: float) -> None:
    piece = Piece(np.array([1.0, 0.0]), 0.0, None, 0.0, WIDE, 0, -1)
    line = WallLine(piece.along, 0.0, 0.3, "ASSUMED", 0.0, WIDE, [piece])
    assert ceiling_along(plan(ceiling), line, 0, room_level) == pytest.approx(expected, abs=0.07)
    gable = Piece(np.array([0.0, 1.0]), -WIDE, None, 0.0, DEEP, 0, -1)
    line = WallLine(gable.along, -WIDE, 0.3, "ASSUMED", 0.0, DEEP, [gable])
    highest = {slope: slope(np.array([DEEP]))[0], level: expected}[ceiling]
    assert ceiling_along(plan(ceiling), line, 0, room_level) == pytest.approx(highest, abs=0.2)
