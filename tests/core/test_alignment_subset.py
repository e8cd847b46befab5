"""The returns chosen for the alignment depend on the returns alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from bim_verify.core.alignment.subset import choose_returns
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.scans.campaign import ReturnBlock, Station
from bim_verify.core.simulation.box_building import (
    ArraySource,
    building_model,
    four_room_stations,
    four_rooms,
    scan,
)


@pytest.fixture(scope="module")
def source() -> ArraySource:
    return scan(building_model(four_rooms()), four_room_stations()[:2], step_deg=2.0)


@dataclass
class Shuffled(ArraySource):
    """The same returns backwards and in small blocks."""

    def blocks(self, block_size: int = 262_144, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        for block in list(super().blocks(777))[::-1]:
            yield ReturnBlock(block.station, block.offsets[::-1].copy())


@pytest.mark.parametrize("most", [200_000, 5_000])
def test_order_and_blocks_do_not_matter(source: ArraySource, most: int) -> None:
    first = choose_returns(source, most=most)
    second = choose_returns(Shuffled(source.stations, source.offsets), most=most)
    assert np.array_equal(first.position, second.position)
    assert np.array_equal(first.normal, second.normal)
    assert len(first) <= most


def test_a_station_split_over_two_files_does_not_matter(source: ArraySource) -> None:
    a, b = source.offsets
    place = source.stations
    split = ArraySource((place[0], place[1], Station("again", place[0].position)), (a[:5000], b, a[5000:]))
    first, second = choose_returns(source, most=5000), choose_returns(split, most=5000)
    assert np.array_equal(first.position, second.position)


def test_another_seed_chooses_other_returns_in_the_same_cells(source: ArraySource) -> None:
    first, second = choose_returns(source, most=5000), choose_returns(source, most=5000, seed=1)
    assert len(first) == len(second)
    assert not np.array_equal(first.position, second.position)


def test_normals_look_at_the_station_and_along_the_axes_of_the_building(source: ArraySource) -> None:
    chosen = choose_returns(source)
    flat = chosen.flat
    normal = chosen.normal[flat]
    to_station = chosen.station_position[chosen.station[flat]] - chosen.position[flat]
    assert flat.mean() > 0.5
    assert (np.einsum("ij,ij->i", normal, to_station) > 0).all()
    assert np.median(np.abs(normal).max(axis=1)) > 0.999


def test_what_is_not_finite_is_left_out() -> None:
    offsets = np.array([[1.0, 2.0, 3.0], [np.nan, 0, 0], [np.inf, 0, 0], [4.0, 5.0, 6.0]])
    chosen = choose_returns(ArraySource((Station("a", np.zeros(3)),), (offsets,)))
    assert sorted(chosen.position[:, 0].tolist()) == [1.0, 4.0]


def test_an_empty_scan_is_refused() -> None:
    with pytest.raises(BimVerifyError, match="holds no returns"):
        choose_returns(ArraySource((Station("a", np.zeros(3)),), (np.zeros((0, 3)),)))
