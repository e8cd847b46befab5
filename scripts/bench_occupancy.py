"""Exact ray traversal against the fast way: time, agreement of labels near surfaces, memory.

    python scripts/bench_occupancy.py [--rays 30000000] [--voxel-mm 10] [--room 12,8,3.5] [--threads N] [--no-exact]
        [--processor-time]

The rays are those of stations in a furnished room, read and kept as ``change`` keeps them (``--memory-gb``, beyond it in a
temporary file). Both ways get the same rays with the same guards, the same voxels and the same threads: "shared" is what both
need: votes of returns, voxels that are settled by them, and the guards, which are fitted to neighbouring returns, so that these
are sorted by direction once. "Free space" is what differs: walking all rays, or summing up the bins and asking the voxels.
Labels are compared on all voxels within two voxels of an occupied one.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable, Iterator

import numpy as np
from numba import njit, prange, set_num_threads
from numpy.typing import NDArray

from bim_verify.core.change.look import sensor_model
from bim_verify.core.evidence.collect import StationIndexes
from bim_verify.core.occupancy.bricks import BrickTable
from bim_verify.core.occupancy.epoch import (
    EMPTY,
    UNSEEN,
    cell_set,
    conclude,
    neighbour_keys,
    occupied_voxels,
    owned,
    settled,
)
from bim_verify.core.occupancy.free_space import PASSED, label_voxels
from bim_verify.core.occupancy.grid import CELLS, VoxelGrid
from bim_verify.core.occupancy.station_rays import clear_rays, summarise
from bim_verify.core.occupancy.traverse import walk_rays
from bim_verify.core.progress import Progress
from bim_verify.core.scans.campaign import DropCount, ReturnBlock, Station
from bim_verify.core.scans.store import ReturnStore

NEAR_VOXELS = 2
BLOCK = 262_144
SPOTS = ((0.2, 0.25), (0.75, 0.3), (0.5, 0.6), (0.25, 0.8), (0.8, 0.75))


@njit(cache=True, parallel=True)
def _cast(direction: NDArray[np.float64], station: NDArray[np.float64], size: NDArray[np.float64],
          boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    out = np.empty(len(direction))
    for n in prange(len(direction)):
        best = np.inf
        for axis in range(3):
            d = direction[n, axis]
            if d != 0.0:
                best = min(best, ((size[axis] if d > 0 else 0.0) - station[axis]) / d)
        for b in range(len(boxes)):
            low, high = 0.0, best
            for axis in range(3):
                d = direction[n, axis] if direction[n, axis] != 0.0 else 1e-12
                t0, t1 = (boxes[b, 0, axis] - station[axis]) / d, (boxes[b, 1, axis] - station[axis]) / d
                low, high = max(low, min(t0, t1)), min(high, max(t0, t1))
            if low < high and low > 0.0:
                best = min(best, low)
        out[n] = best
    return out


class Room:
    """A scan source that makes the returns of scanners on their regular grids in a furnished room; noise 1.5 mm."""

    paths: tuple[str, ...] = ("room",)

    def __init__(self, size: NDArray[np.float64], rays: int, stations: int) -> None:
        self.size, self.dropped = size, DropCount()
        self.stations = tuple(
            Station(f"station {n}", np.array([x * size[0], y * size[1], 1.6]) + 0.0123)
            for n, (x, y) in enumerate(SPOTS[:stations])
        )
        self._rows = int(np.sqrt(rays / stations / 2.4))
        self._columns = rays // stations // self._rows
        random = np.random.default_rng(7)
        low = random.uniform([0.3, 0.3, 0.0], [size[0] - 1.2, size[1] - 1.2, 0.6], (14, 3))
        low[:10, 2] = 0.0
        self._boxes = np.stack([low, low + random.uniform(0.15, 0.9, (14, 3))], axis=1)

    @property
    def point_count(self) -> int:
        return len(self.stations) * self._rows * self._columns

    def blocks(self, block_size: int = BLOCK, *, attributes: bool = False) -> Iterator[ReturnBlock]:
        """Row after row."""
        for number, station in enumerate(self.stations):
            random = np.random.default_rng(number)
            here = station.position
            free = [not ((b[0] - 0.4 < here) & (b[1] + 0.4 > here)).all() for b in self._boxes]
            at_once = max(block_size // self._columns, 1)
            elevation = np.linspace(np.radians(-60), np.radians(89.9), self._rows)
            for first in range(0, self._rows, at_once):
                direction = self._directions(elevation[first : first + at_once])
                reach = _cast(direction, here, self.size, self._boxes[free])
                reach += 0.0015 * random.standard_normal(len(reach))
                yield ReturnBlock(number, direction * reach[:, None])

    def _directions(self, elevation: NDArray[np.float64]) -> NDArray[np.float64]:
        azimuth = np.linspace(0, 2 * np.pi, self._columns, endpoint=False)[None, :]
        flat, shape = np.cos(elevation)[:, None], (len(elevation), self._columns)
        return np.stack([
            flat * np.cos(azimuth), flat * np.sin(azimuth), np.broadcast_to(np.sin(elevation)[:, None], shape)
        ], axis=2).reshape(-1, 3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rays", type=int, default=30_000_000)
    parser.add_argument("--stations", type=int, default=4, choices=range(1, len(SPOTS) + 1))
    parser.add_argument("--voxel-mm", type=float, default=10.0)
    parser.add_argument("--room", default="12,8,3.5")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--memory-gb", type=float, default=1.5, help="for the returns; change gives half of its own, 3 GB")
    parser.add_argument(
        "--processor-time", action="store_true",
        help="count processor time, not the clock's: for a machine that others use too, best with --threads 1",
    )
    parser.add_argument("--no-exact", action="store_true", help="only the fast way, for its memory")
    options = parser.parse_args()
    if options.threads:
        set_num_threads(options.threads)
    size = np.array([float(v) for v in options.room.split(",")])
    grid = VoxelGrid.for_model(np.zeros(3), options.voxel_mm / 1000)
    with ReturnStore(Room(size, 40_000, 2), 0.1) as store:  # compile before the clock runs
        compare(store, grid, True, lambda text: None)
    room = Room(size, options.rays, options.stations)
    print(f"{room.point_count / 1e6:.1f} M rays from {len(room.stations)} stations, room {options.room} m, "
          f"voxels of {options.voxel_mm:g} mm")
    with ReturnStore(room, options.memory_gb) as store:
        print("returns kept in " + ("memory" if store.fits else "a temporary file"))
        compare(store, grid, not options.no_exact, print, time.process_time if options.processor_time else time.perf_counter)


def compare(
    store: ReturnStore, grid: VoxelGrid, exact: bool, say: Callable[[str], None],
    clock: Callable[[], float] = time.perf_counter,
) -> None:
    """Label the voxels near surfaces the fast way and, if asked, the exact way, and say how these compare."""
    sensor, progress = sensor_model(0.0015), Progress()
    stations = StationIndexes(store, np.zeros(3))
    begin = clock()
    occupied = occupied_voxels(stations, grid, 3, sensor, progress)
    votes = clock() - begin
    table, near = surroundings(occupied.table, occupied.cells)
    say(f"occupied voxels {occupied.count / 1e6:.2f} M, voxels near them {int(near.sum()) / 1e6:.2f} M")
    begin = clock()
    state = settled(occupied, table, near)
    shared = votes + clock() - begin
    say(f"shared: sorting and votes {votes:.1f} s, voxels settled by them {shared - votes:.1f} s")
    asked = near & (state == UNSEEN)
    labels = np.zeros(asked.shape, np.uint8)
    walked = np.zeros(asked.shape if exact else (0, CELLS), np.bool_)
    fast = slow = 0.0
    loop = clock()
    for station, index, sector in stations.visit(sensor, progress):
        clear = clear_rays(index, stations.count(station), grid.edge, owned(index.returns, sector))
        begin = clock()
        rays = summarise(clear)
        label_voxels(table.keys, asked, stations.position[station], grid.anchor, grid.edge, rays, labels, sector)
        fast += clock() - begin
        if exact:
            begin = clock()
            walk_rays(clear.end, stations.position[station], grid.anchor, grid.edge, table, walked)
            slow += clock() - begin
    guards = clock() - loop - fast - slow
    say(f"shared: guards of rays {guards:.1f} s")
    say(f"free space the fast way {fast:.1f} s")
    say(f"peak memory{' of both ways together' if exact else ''} "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")
    if not exact:
        return
    between = int((asked & (labels > 0) & (labels & PASSED == 0)).sum())
    say(f"between rays that lie farther apart than voxels: {between / 1e6:.3f} M voxels, compared as what rays alone say")
    exact_state = state.copy()
    conclude(state, labels & PASSED)
    conclude(exact_state, np.where(walked, PASSED, 0).astype(np.uint8))
    same = int((near & (state == exact_state)).sum()) / int(near.sum())
    told = int((near & ((state == EMPTY) | (exact_state == EMPTY))).sum())
    differ = int((near & (state != exact_state)).sum())
    say(f"labels equal on {100 * same:.4f} % of the voxels near surfaces; of the {told / 1e6:.2f} M that rays empty, "
        f"{differ} differ")
    shared += guards
    say(f"free space: exact {slow:.1f} s, fast {fast:.1f} s: {slow / fast:.1f} times faster")
    say(f"with what both share: exact {slow + shared:.1f} s, fast {fast + shared:.1f} s: "
        f"{(slow + shared) / (fast + shared):.1f} times faster")


@njit(cache=True, parallel=True)
def _dilate(around: NDArray[np.int32], cells: NDArray[np.bool_], reach: int, out: NDArray[np.bool_]) -> None:
    for row in prange(len(around)):
        wide = np.zeros((8 + 2 * reach, 8 + 2 * reach, 8 + 2 * reach), np.bool_)  # the brick and what lies around it
        some = False
        for i in range(-reach, 8 + reach):
            for j in range(-reach, 8 + reach):
                for k in range(-reach, 8 + reach):
                    wide[i + reach, j + reach, k + reach] = cell_set(cells, around, row, i, j, k)
                    some |= wide[i + reach, j + reach, k + reach]
        if not some:
            continue
        for axis in range(3):  # one axis after the other
            before = wide.copy()
            for i in range(wide.shape[0]):
                for j in range(wide.shape[1]):
                    for k in range(wide.shape[2]):
                        if before[i, j, k]:
                            for step in range(-reach, reach + 1):
                                a, b, c = i + step * (axis == 0), j + step * (axis == 1), k + step * (axis == 2)
                                if min(a, b, c) >= 0 and max(a, b, c) < wide.shape[0]:
                                    wide[a, b, c] = True
        for cell in range(CELLS):
            out[row, cell] = wide[(cell >> 6) + reach, ((cell >> 3) & 7) + reach, (cell & 7) + reach]


def surroundings(source: BrickTable, cells: NDArray[np.bool_]) -> tuple[BrickTable, NDArray[np.bool_]]:
    """Bricks, and (B, 512) their voxels within NEAR_VOXELS of a set cell of ``source``."""
    keys = np.unique(neighbour_keys(source.keys))
    around = source.around(keys)
    near = np.zeros((len(keys), CELLS), np.bool_)
    _dilate(around, cells, NEAR_VOXELS, near)
    some = near.any(axis=1)
    return BrickTable(keys[some]), near[some]


if __name__ == "__main__":
    main()
