"""Voxels of one epoch: the fast way equals the exact one, and nothing depends on order, tiles or threads."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numba
import numpy as np
import pytest

from bim_verify.core.change.look import sensor_model
from bim_verify.core.evidence.collect import StationIndexes
from bim_verify.core.evidence.station_index import build_index
from bim_verify.core.occupancy.bricks import BrickTable
from bim_verify.core.occupancy.epoch import EMPTY, NEAR, OCCUPIED, neighbour_keys, observe, occupied_voxels
from bim_verify.core.occupancy.free_space import PASSED, label_voxels
from bim_verify.core.occupancy.grid import CELLS, VoxelGrid, keys_of, voxel_index
from bim_verify.core.occupancy.station_rays import station_rays
from bim_verify.core.occupancy.traverse import walk_rays
from bim_verify.core.occupancy.votes import Votes
from bim_verify.core.parallel import spread
from bim_verify.core.progress import Progress
from bim_verify.core.scans.campaign import Station
from bim_verify.core.scans.store import ReturnStore, in_sector
from bim_verify.core.simulation.box_building import ArraySource

SIZE = np.array([3.0, 2.4, 2.0])
STATION = np.array([1.013, 1.107, 1.009])
SECOND = STATION + np.array([0.8, 0.3, 0.1])
GRID = VoxelGrid.for_model(np.zeros(3), 0.02)


def room(count: int, station: np.ndarray = STATION, seed: int = 0) -> np.ndarray:
    """(N, 3) returns from the walls of an empty room, 1 mm noise; single precision."""
    random = np.random.default_rng(seed)
    direction = random.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    with np.errstate(divide="ignore"):
        reach = np.where(direction > 0, (SIZE - station) / direction, -station / direction).min(axis=1)
    return (direction * (reach + 0.001 * random.standard_normal(count))[:, None]).astype(np.float32)


def all_bricks(low: float = -0.2) -> BrickTable:
    axis = [np.arange(int(low / 0.02) // 8 * 8, int((s - low) / 0.02) + 8, 8) for s in SIZE]
    corner = np.stack(np.meshgrid(*axis, indexing="ij"), axis=-1).reshape(-1, 3)
    return BrickTable(np.unique(keys_of(corner)[0]))


def test_keys_and_cells_give_back_the_voxel() -> None:
    index = np.random.default_rng(1).integers(-5000, 5000, (1000, 3))
    assert (voxel_index(*keys_of(index)) == index).all()


def test_grid_is_fixed_to_the_model_frame() -> None:
    near, far = VoxelGrid.for_model(np.array([0.0, 0.0, 0.0]), 0.03), VoxelGrid.for_model(np.array([7.0, -3.0, 1.0]), 0.03)
    place = np.array([[7.511, -2.404, 1.302]])
    center = near.centers(near.index(place))
    origin = np.array([7.0, -3.0, 1.0])
    there = far.centers(far.index(place - origin)) + origin
    assert np.allclose(center, there, atol=1e-9)


@pytest.mark.parametrize("count", [60_000, 400_000])  # rays farther apart than half a voxel, and closer
def test_fast_labels_equal_exact_traversal(count: int) -> None:
    rays = station_rays(build_index(room(count)), count, GRID.edge)
    table = all_bricks()
    walked = np.zeros((len(table), CELLS), np.bool_)
    steps = walk_rays(rays.end, STATION, GRID.anchor, GRID.edge, table, walked)
    labels = np.zeros((len(table), CELLS), np.uint8)
    label_voxels(table.keys, np.ones_like(walked), STATION, GRID.anchor, GRID.edge, rays, labels)
    assert steps > 1_000_000
    assert (walked != ((labels & PASSED) > 0)).sum() <= 5  # single precision at the very edge of a voxel
    assert walked.mean() > 0.3


def test_guard_keeps_surfaces_from_being_emptied() -> None:
    returns = room(200_000)
    rays = station_rays(build_index(returns), len(returns), GRID.edge)
    end = rays.end + STATION
    free_depth = np.minimum(end, SIZE - end).min(axis=1)
    assert np.quantile(free_depth, 0.01) > 1.2 * GRID.edge
    lost = np.linalg.norm(returns, axis=1).mean() - np.linalg.norm(rays.end, axis=1).mean()
    assert lost < 4 * GRID.edge


def test_votes_do_not_depend_on_order_or_blocks() -> None:
    returns = room(30_000)
    whole, parts = Votes(GRID, 3), Votes(GRID, 3)
    whole.add(returns, STATION, 0.01)
    for block in np.array_split(np.random.default_rng(3).permutation(returns), 7):
        parts.add(np.ascontiguousarray(block), STATION, 0.01)
    a, b = whole.occupied(), parts.occupied()
    assert (a.table.keys == b.table.keys).all() and (a.cells == b.cells).all() and a.sparse == b.sparse


def test_a_dense_scan_needs_three_returns_and_a_sparse_one_says_that_it_does_not() -> None:
    spot = np.array([[1.0, 0.003, 0.003]])
    dense, sparse = Votes(GRID, 3), Votes(GRID, 3)
    dense.add(np.repeat(spot, 2, axis=0), np.zeros(3), 0.001)
    sparse.add(spot, np.zeros(3), 0.03)
    assert dense.occupied().count == 0
    assert sparse.occupied().count == 1 and sparse.occupied().sparse == 1


@pytest.mark.parametrize("least, expected", [(5, 3), (7, 3), (300, 20), (1000, 40)])
def test_half_of_the_returns_that_a_sparse_surface_sends_are_enough(least: int, expected: int) -> None:
    spacing = GRID.edge * np.sqrt(0.5 / expected)
    spot = np.array([[1.0, 0.003, 0.003]], np.float32)
    few, enough, many = (Votes(GRID, least) for _ in range(3))
    few.add(np.repeat(spot, expected - 1, axis=0), np.zeros(3), spacing)
    enough.add(np.repeat(spot, expected, axis=0), np.zeros(3), spacing)
    many.add(np.repeat(spot, least, axis=0), np.zeros(3), spacing)
    assert few.occupied().count == 0
    assert enough.occupied().count == 1 and enough.occupied().sparse == 1
    assert many.occupied().count == 1 and many.occupied().sparse == 0


def test_returns_outside_of_what_is_asked_have_no_vote() -> None:
    near, far = room(20_000), np.tile(np.float32([30.0, 4.0, 1.0]), (50, 1))
    within = np.array([[-1.0] * 3, SIZE + 1.0])
    asked, everything = Votes(GRID, 3, within), Votes(GRID, 3)
    alone = Votes(GRID, 3)
    alone.add(near, STATION, 0.02)
    for votes in (asked, everything):
        votes.add(np.concatenate([near, far]), STATION, 0.02)
    assert (asked.occupied().table.keys == alone.occupied().table.keys).all()
    assert (asked.occupied().cells == alone.occupied().cells).all()
    assert everything.occupied().count == alone.occupied().count + 1


def test_room_for_bricks_grows_as_they_come() -> None:
    wide = np.random.default_rng(2).uniform(-30.0, 30.0, (150_000, 3)).astype(np.float32)
    votes = Votes(GRID, 1)
    votes.add(wide, STATION, 0.01)
    found, index = votes.occupied(), np.unique(GRID.index(wide + STATION), axis=0)
    assert found.count == len(index) and len(found.table) > 100_000


def test_sectors_share_out_all_directions_in_single_precision() -> None:
    direction = np.array([[1.0, -1e-9, 0.0], [1.0, 0.0, 0.0], [-1.0, 1e-9, 0.3], [-1.0, -1e-9, 0.3]], np.float32)
    edges = [0.0, 1.0, np.pi, 2 * np.pi + 1e-9]
    assert (sum(in_sector(direction, a, b).astype(int) for a, b in pairwise(edges)) == 1).all()


@pytest.mark.parametrize("total", [1, 2, 7, 64, 997, 1000])
def test_spread_work_comes_once_and_evenly(total: int) -> None:
    parts = np.arange(total) * spread(total) % total
    assert (np.sort(parts) == np.arange(total)).all()
    if total > 50:
        assert abs(parts[: total // 2].mean() - total / 2) < 0.05 * total


def observed(
    memory_gb: float, order: np.ndarray | None = None, swap: bool = False,
    seen: Callable[[np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    returns = [room(40_000), room(40_000, SECOND, 5)]
    if seen is not None:
        returns = [r[seen(r)] for r in returns]
    if order is not None:
        returns = [r[order] for r in returns]
    stations = (Station("a", STATION), Station("b", SECOND))
    if swap:
        returns, stations = returns[::-1], stations[::-1]
    table = all_bricks()
    with ReturnStore(ArraySource(stations, returns), memory_gb) as store:
        indexes = StationIndexes(store, np.zeros(3))
        sensor = sensor_model(0.001)
        found = occupied_voxels(indexes, GRID, 3, sensor, Progress())
        wanted = np.ones((len(table), CELLS), np.bool_)
        return observe(indexes, GRID, found, table, wanted, sensor, Progress()).state


def test_result_does_not_depend_on_order_or_threads() -> None:
    first = observed(1.0)
    assert {OCCUPIED, NEAR, EMPTY} <= set(np.unique(first))
    assert (first == observed(1.0, np.random.default_rng(2).permutation(40_000))).all()
    before = numba.get_num_threads()
    assert (first == observed(1.0, swap=True)).all()
    try:
        numba.set_num_threads(1)
        assert (first == observed(1.0)).all()
    finally:
        numba.set_num_threads(before)


def test_result_does_not_depend_on_tiles() -> None:
    whole = observed(1.0)
    for memory_gb in (0.002, 0.00075):  # 2 and 4 tiles of each station
        assert (whole == observed(memory_gb)).all()


@pytest.mark.parametrize("seen", [
    lambda r: r[:, 2] < 0, lambda r: (r[:, 0] > 0) & (np.abs(r[:, 2]) < 0.6 * r[:, 0]),
], ids=["half a sphere", "a sector"])
def test_result_does_not_depend_on_tiles_where_only_a_part_of_the_view_is_scanned(
    seen: Callable[[np.ndarray], np.ndarray],
) -> None:
    """The returns then lie closer together than so many all around would: bins are wider, in spacings."""
    whole = observed(1.0, seen=seen)
    for memory_gb in (0.0004, 0.00012):
        assert (whole == observed(memory_gb, seen=seen)).all()


def test_returns_in_a_file_are_sorted_once_and_stay_the_same() -> None:
    returns = [room(20_000, seed=seed) for seed in range(4)]
    stations = tuple(Station(str(n), STATION) for n in range(4))
    kept = []
    for memory_gb in (1.0, 0.00225):
        with ReturnStore(ArraySource(stations, returns), memory_gb) as store:
            indexes = StationIndexes(store, np.zeros(3))
            for _ in range(2):
                tiles = indexes.visit(sensor_model(0.001), Progress())
                seen = [(i.returns, i.bin_start, i.spacing_rad, sector) for _, i, sector in tiles]
            assert store.fits == (memory_gb == 1.0) and all(sector is None for *_, sector in seen)
            assert [store.count(n) for n in range(4)] == [20_000] * 4
            kept.append(seen)
    for (a, a_start, a_spacing, _), (b, b_start, b_spacing, _) in zip(*kept, strict=True):
        assert (a == b).all() and (a_start == b_start).all() and a_spacing == b_spacing


def test_an_occupied_voxel_is_not_emptied_by_rays_that_graze_it() -> None:
    state = observed(1.0)
    table = all_bricks()
    votes = Votes(GRID, 3)
    votes.add(room(40_000), STATION, build_index(room(40_000)).spacing_rad)
    found = votes.occupied()
    rows = table.rows(found.table.keys)
    assert (state[rows][found.cells] == OCCUPIED).all()


@pytest.mark.parametrize("reach", [1])
def test_neighbours_of_a_brick(reach: int) -> None:
    keys, _ = keys_of(np.array([[0, 0, 0]]))
    around = neighbour_keys(keys)[0]
    middle = voxel_index(around, np.zeros(27, np.int64)) // 8
    assert np.abs(middle).max() == reach and len(np.unique(middle, axis=0)) == 27 and (middle[13] == 0).all()
