"""Exact ray traversal against the fast way: time, agreement of labels near surfaces, memory.

    python scripts/bench_occupancy.py [--rays 30000000] [--voxel-mm 10] [--room 12,8,3.5] [--threads N] [--exact-share 1]

The rays are those of stations in a furnished room; both ways get the same rays, the same guards and the same threads.
Labels are compared on all voxels within two voxels of an occupied one.
"""

from __future__ import annotations

import argparse
import resource
import time

import numpy as np
from numba import njit, prange, set_num_threads
from numpy.typing import NDArray

from bim_verify.core.evidence.station_index import build_index
from bim_verify.core.occupancy.bricks import BrickTable
from bim_verify.core.occupancy.clear_range import clear_range
from bim_verify.core.occupancy.epoch import UNSEEN, cell_set, conclude, neighbour_keys, settled
from bim_verify.core.occupancy.free_space import PASSED, label_voxels
from bim_verify.core.occupancy.grid import CELLS, VoxelGrid
from bim_verify.core.occupancy.traverse import walk_rays
from bim_verify.core.occupancy.votes import Votes

NEAR_VOXELS = 2


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


def scan(station: NDArray[np.float64], count: int, size: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """(N, 3) returns of a scanner on its regular grid in the room, from the station [m]; noise 1.5 mm."""
    rows = int(np.sqrt(count / 2.4))
    columns = count // rows
    elevation = np.linspace(np.radians(-60), np.radians(89.9), rows)[:, None]
    azimuth = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None, :]
    flat = np.cos(elevation)
    direction = np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.broadcast_to(np.sin(elevation), (rows, columns))], axis=2
    ).reshape(-1, 3)
    random = np.random.default_rng(7)
    low = random.uniform([0.3, 0.3, 0.0], [size[0] - 1.2, size[1] - 1.2, 0.6], (14, 3))
    low[:10, 2] = 0.0
    boxes = np.stack([low, low + random.uniform(0.15, 0.9, (14, 3))], axis=1)
    boxes = boxes[[not ((b[0] - 0.4 < station) & (b[1] + 0.4 > station)).all() for b in boxes]]
    reach = _cast(np.ascontiguousarray(direction), station, size, boxes)
    reach += 0.0015 * np.random.default_rng(seed).standard_normal(len(reach))
    direction *= reach[:, None]
    return direction


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rays", type=int, default=30_000_000)
    parser.add_argument("--stations", type=int, default=4)
    parser.add_argument("--voxel-mm", type=float, default=10.0)
    parser.add_argument("--room", default="12,8,3.5")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--no-exact", action="store_true", help="only the fast way, for its memory")
    options = parser.parse_args()
    if options.threads:
        set_num_threads(options.threads)
    size = np.array([float(v) for v in options.room.split(",")])
    edge = options.voxel_mm / 1000
    grid = VoxelGrid.for_model(np.zeros(3), edge)
    spots = np.array([[0.2, 0.25], [0.75, 0.3], [0.5, 0.6], [0.25, 0.8], [0.8, 0.75]])[: options.stations]
    positions = [np.array([x * size[0], y * size[1], 1.6]) + 0.0123 for x, y in spots]
    warm = build_index(scan(positions[0], 20_000, size, 0))
    for exact in (False, True):  # compile before the clock runs
        run([warm.returns], positions[:1], grid, exact)
    rays = [scan(p, options.rays // len(positions), size, n) for n, p in enumerate(positions)]
    total = sum(len(r) for r in rays)
    spare = None if options.no_exact else list(rays)
    print(f"{total / 1e6:.1f} M rays from {len(rays)} stations, room {options.room} m, voxels of {options.voxel_mm:g} mm")
    fast, occupied, seconds, _, near = run(rays, positions, grid, False)
    print(f"occupied voxels {occupied / 1e6:.2f} M, voxels near them {int(near.sum()) / 1e6:.2f} M")
    print("fast  " + ", ".join(f"{k} {v:.1f} s" for k, v in seconds.items()))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"peak memory of the fast way {peak:.2f} GB")
    if options.no_exact:
        return
    slow, _, exact_seconds, _, _ = run(spare, positions, grid, True)
    print("exact " + ", ".join(f"{k} {v:.1f} s" for k, v in exact_seconds.items()))
    same = (fast[near] == slow[near]).mean()
    print(f"labels equal on {100 * same:.4f} % of the voxels near surfaces")
    print(f"free space: exact {exact_seconds['free space']:.1f} s, fast {seconds['free space']:.2f} s, "
          f"{exact_seconds['free space'] / seconds['free space']:.1f} times faster")
    whole = sum(exact_seconds.values()) / sum(seconds.values())
    print(f"all of it (sorting, guards, votes, free space): {whole:.1f} times faster")


def run(
    rays: list[NDArray[np.float64]], positions: list[NDArray[np.float64]], grid: VoxelGrid, exact: bool
) -> tuple[NDArray[np.uint8], int, dict[str, float], BrickTable, NDArray[np.bool_]]:
    """States (B, 512), occupied voxels, seconds a stage, bricks, and which voxels are near."""
    seconds = {"sorting": 0.0, "guards": 0.0, "votes": 0.0, "free space": 0.0}
    clock = time.perf_counter()

    def lap(stage: str) -> None:
        nonlocal clock
        now = time.perf_counter()
        seconds[stage] += now - clock
        clock = now

    votes = Votes(grid, 3)
    kept = []
    for position in positions:
        index = build_index(rays.pop(0))
        lap("sorting")
        votes.add(index.returns, position, index.spacing_rad)
        lap("votes")
        kept.append((index, clear_range(index, grid.edge)))
        lap("guards")
    occupied = votes.occupied()
    lap("votes")
    table = BrickTable(np.unique(neighbour_keys(occupied.table.keys)))
    near = dilate(table, occupied.table, occupied.cells)  # only to compare
    clock = time.perf_counter()
    state = settled(occupied, table, near)
    labels = np.zeros((len(table), CELLS), np.uint8)
    if exact:
        walked = np.zeros((len(table), CELLS), np.bool_)
        for (index, clear), position in zip(kept, positions, strict=True):
            walk_rays(index.returns, clear.share, position, grid.anchor, grid.edge, table, walked)
        labels[walked] = PASSED
    else:
        asked = near & (state == UNSEEN)
        for (index, clear), position in zip(kept, positions, strict=True):
            label_voxels(table.keys, asked, position, grid.anchor, grid.edge, index, clear, labels)
        passed_only = labels & PASSED
        interpolated = int((near & (labels > 0) & (passed_only == 0)).sum())
        print(f"between rays that lie farther apart than voxels: {interpolated / 1e6:.3f} M voxels, compared as unknown")
        labels = passed_only
    conclude(state, labels)
    lap("free space")
    return state, occupied.count, seconds, table, near


@njit(cache=True, parallel=True)
def _dilate(around: NDArray[np.int32], cells: NDArray[np.bool_], reach: int, out: NDArray[np.bool_]) -> None:
    for row in prange(len(around)):
        for cell in range(CELLS):
            i, j, k = cell >> 6, (cell >> 3) & 7, cell & 7
            for a in range(-reach, reach + 1):
                for b in range(-reach, reach + 1):
                    for c in range(-reach, reach + 1):
                        if not out[row, cell] and cell_set(cells, around, row, i + a, j + b, k + c):
                            out[row, cell] = True


def dilate(table: BrickTable, source: BrickTable, cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(B, 512) the voxels of ``table`` within NEAR_VOXELS of a set cell of ``source``."""
    around = source.rows(neighbour_keys(table.keys).ravel()).reshape(-1, 27)
    out = np.zeros((len(table), CELLS), np.bool_)
    _dilate(around, cells, NEAR_VOXELS, out)
    return out


if __name__ == "__main__":
    main()
