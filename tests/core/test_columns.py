"""Columns from returns about them: place, size, turn, what is hidden, and what is no column."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from shapely import LineString, Point, Polygon, affinity, box
from shapely.geometry.base import BaseGeometry

from bim_verify.core.planes.fit import Plane, fit_plane
from bim_verify.core.planes.noise import PointNoise
from bim_verify.core.planes.unevenness import with_unevenness
from bim_verify.core.reconstruction.column_fit import ColumnShape, fit_column

Array = NDArray[np.float64]
BAND_M = 0.01
NOISE_M = 0.002
ALL_ROUND = ((-2.5, -1.5), (2.8, -1.0), (0.4, 3.0))


def scanned(*things: tuple[BaseGeometry, float], stations: tuple[tuple[float, float], ...]) -> tuple[Array, Array]:
    """Returns of upright things (outline, height), and the station of each; 0.5 degrees, 2.4 m high."""
    random = np.random.default_rng(4)
    points, seen = [], []
    for x, y in stations:
        for angle in np.arange(0.0, 2 * np.pi, np.radians(0.5)) + random.uniform(0.0, 0.01):
            ray = np.array([np.cos(angle), np.sin(angle)])
            line = LineString([(x, y), (x + 6 * ray[0], y + 6 * ray[1])])
            near = [(Point(x, y).distance(hit), high) for s, high in things if not (hit := line.intersection(s)).is_empty]
            for z in np.arange(0.1, 2.4, 0.04):
                distance = min((d for d, high in near if z < high), default=None)
                if distance is not None:
                    reach = distance + NOISE_M * random.standard_normal()
                    points.append((x + reach * ray[0], y + reach * ray[1], z))
                    seen.append((x, y, 1.5))
    return np.array(points), np.array(seen)


def fitted(points: Array, stations: Array, pose_sigma: float = 0.0) -> ColumnShape | None:
    noise = PointNoise(NOISE_M)

    def face(rows: NDArray[np.int64]) -> Plane:
        return with_unevenness(fit_plane(points[rows], stations[rows], noise), points[rows])[0]

    return fit_column(points, stations, BAND_M, face, pose_sigma)


def pillar(turn_deg: float, length: float = 0.5, width: float = 0.3) -> Polygon:
    """About the origin."""
    turned = affinity.rotate(box(-length / 2, -width / 2, length / 2, width / 2), turn_deg, origin=(0, 0))
    assert isinstance(turned, Polygon)
    return turned


def size_and_turn(shape: ColumnShape) -> tuple[float, float, float]:
    """Length, width, and turn of the longer side [deg], 0 to 180."""
    corner = np.array(shape.footprint.exterior.coords)
    side = np.diff(corner, axis=0)[:2]
    length = np.linalg.norm(side, axis=1)
    along = side[int(np.argmax(length))]
    return float(length.max()), float(length.min()), float(np.degrees(np.arctan2(along[1], along[0])) % 180)


@pytest.mark.parametrize("turn", [0.0, 20.0, 71.0])
def test_a_column_seen_from_all_round_is_where_and_how_it_stands(turn: float) -> None:
    found = fitted(*scanned((pillar(turn), 2.5), stations=ALL_ROUND))
    assert found is not None and found.radius == 0.0 and found.hidden == () and found.seen == 1.0
    length, width, turned = size_and_turn(found)
    off = float(np.hypot(found.footprint.centroid.x, found.footprint.centroid.y))
    assert off < 0.001 and off < 4 * found.position_sigma < 0.004
    assert abs(length - 0.5) < 0.001 and abs(width - 0.3) < 0.001
    assert abs((turned - turn + 90) % 180 - 90) < 0.3
    # the mean of absolute values of a normal distribution is 0.8 of its standard deviation, and less than it in any
    assert 0.001 < found.residual_mean < 0.9 * found.residual_sigma < NOISE_M


def test_what_stands_beside_it_turned_does_not_turn_it() -> None:
    cupboard = affinity.translate(pillar(50.0, 0.4, 0.25), 0.1, -0.4)
    found = fitted(*scanned((pillar(20.0), 2.5), (cupboard, 1.0), stations=ALL_ROUND))
    assert found is not None
    length, width, turned = size_and_turn(found)
    assert abs(length - 0.5) < 0.003 and abs(width - 0.3) < 0.003 and abs(turned - 20.0) < 0.5
    assert found.on < 0.95


def test_sides_that_nobody_saw_are_named_and_follow_from_the_edges_of_the_others() -> None:
    found = fitted(*scanned((pillar(0.0), 2.5), stations=((-2.0, -1.5), (-1.5, -2.2))))
    assert found is not None and found.hidden == ("right", "back") and found.seen == pytest.approx(0.5, abs=0.05)
    length, width, _ = size_and_turn(found)
    assert abs(length - 0.5) < 0.015 and abs(width - 0.3) < 0.015
    off = max(abs(found.footprint.centroid.x), abs(found.footprint.centroid.y))
    assert 0.0005 < found.position_sigma < 0.01 and off < 3 * found.position_sigma
    moved = fitted(*scanned((pillar(0.0), 2.5), stations=((-2.0, -1.5), (-1.5, -2.2))), pose_sigma=0.02)
    assert moved is not None and moved.position_sigma == pytest.approx(np.hypot(found.position_sigma, 0.02))


def test_a_round_column_has_its_radius() -> None:
    found = fitted(*scanned((Point(0.0, 0.0).buffer(0.2, 64), 2.5), stations=ALL_ROUND))
    assert found is not None and abs(found.radius - 0.2) < 0.001
    assert np.hypot(found.footprint.centroid.x, found.footprint.centroid.y) < min(0.001, 4 * found.position_sigma)


def test_a_board_and_a_heap_are_no_columns() -> None:
    assert fitted(*scanned((box(-0.4, 0.0, 0.4, 0.001), 2.5), stations=((0.0, -2.0), (0.3, -2.5)))) is None
    heap = np.random.default_rng(2).uniform((-0.3, -0.3, 0.1), (0.3, 0.3, 2.4), (4000, 3))
    assert fitted(heap, np.tile([2.0, 2.0, 1.5], (len(heap), 1))) is None
