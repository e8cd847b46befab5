"""Walls of which a part lies a few centimetres before the rest: boards, linings, wainscots; and walls that lean."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bim_verify.core.planes.surfels import Surfels
from bim_verify.core.reconstruction.crossings import Crossings
from bim_verify.core.reconstruction.faces import Face, find_faces
from bim_verify.core.reconstruction.steps import find_step

Array = NDArray[np.float64]
EDGE_M = 0.06
LENGTH_M, HEIGHT_M = 7.0, 2.7
BOARD, LINING, WAINSCOT, HALF = (2.4, 4.4, 0.9, 2.1), (3.0, 3.9, 0.0, 2.7), (0.0, 7.0, 0.0, 1.1), (0.0, 4.2, 0.0, 2.7)


def places(spacing: float) -> tuple[Array, Array]:
    """Along a wall and up it."""
    u, z = np.meshgrid(np.arange(spacing / 2, LENGTH_M, spacing), np.arange(spacing / 2, HEIGHT_M, spacing))
    return u.ravel(), z.ravel()


def surfels(u: Array, off: Array, z: Array) -> Surfels:
    """Of a wall along x that was seen from the side of -y; ``off`` is how far before the wall's plane."""
    count = len(u)
    off = off + np.random.default_rng(1).normal(0.0, 0.0005, count)
    normal = np.tile([0.0, -1.0, 0.0], (count, 1))
    return Surfels(
        np.column_stack([u, -off, z]), normal, np.full(count, 0.002), np.full(count, 0.01), np.full(count, EDGE_M**2),
        np.full(count, 20),
    )  # fmt: skip


def before(part: tuple[float, float, float, float], by: float, spacing: float = EDGE_M) -> tuple[Array, Array, Array]:
    u, z = places(spacing)
    inside = (u > part[0]) & (u < part[1]) & (z > part[2]) & (z < part[3])
    return u, np.where(inside, by, 0.0), z


def area_at(faces: list[Face], off: float) -> float:
    """Of the faces whose plane lies there."""
    return sum(float(f.area.sum()) for f in faces if abs(f.offset - off) < 0.002 and f.normal[1] < -0.999)


@pytest.mark.parametrize("part", [BOARD, LINING, WAINSCOT, HALF])
@pytest.mark.parametrize("by", [0.016, 0.02, 0.024, 0.03, 0.04])
def test_what_stands_before_a_wall_takes_nothing_of_it(part: tuple[float, float, float, float], by: float) -> None:
    faces = find_faces(surfels(*before(part, by)))
    covered = (part[1] - part[0]) * (part[3] - part[2])
    assert area_at(faces, 0.0) == pytest.approx(LENGTH_M * HEIGHT_M - covered, rel=0.06)
    assert area_at(faces, by) == pytest.approx(covered, rel=0.1)


@pytest.mark.parametrize("bare", [(2.5, 4.5), (4.2, 7.0), (0.0, 1.0)])
def test_a_wall_is_straight_though_a_lining_of_a_centimetre_ends_on_it(bare: tuple[float, float]) -> None:
    """The smaller part is bare; both are within reach of one line, which must not turn to hold both."""
    u, off, z = before((*bare, 0.0, HEIGHT_M), -0.01)
    (face,) = find_faces(surfels(u, off, z))
    for end in (0.0, LENGTH_M):
        place = (face.offset - face.normal[0] * end) / face.normal[1]
        assert place == pytest.approx(0.0, abs=0.001)


@pytest.mark.parametrize("lean", [0.02, 0.04])
def test_a_wall_that_leans_is_one_face(lean: float) -> None:
    u, z = places(EDGE_M)
    faces = find_faces(surfels(u, lean * (z / HEIGHT_M - 0.5), z))
    assert len(faces) == 1


@pytest.mark.parametrize(("by", "said"), [(0.02, True), (-0.03, True), (0.011, True), (0.005, False), (0.09, False)])
def test_what_lies_before_or_behind_much_of_a_face_is_said(by: float, said: bool) -> None:
    u, off, z = before(BOARD, by, 0.02)
    depth = -off + np.random.default_rng(2).normal(0.0, 0.002, len(u))
    step = find_step(Crossings(u, z, depth, u, z, np.arange(len(u))), (0.0, LENGTH_M), (0.0, HEIGHT_M), 0.012)
    assert (step is not None) == said
    assert find_step(Crossings(u, z, depth, u, z, np.arange(len(u))), (0.0, LENGTH_M), (0.0, HEIGHT_M), 0.012, [BOARD]) is None
    if step is not None:
        assert step.by == pytest.approx(-by, abs=0.002)
        assert step.share == pytest.approx(2.4 / (LENGTH_M * HEIGHT_M), rel=0.1)
