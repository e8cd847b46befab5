"""A small, well-spread choice of the returns of a campaign, read in one pass with bounded memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import BimVerifyError
from ..progress import Progress
from ..scans.campaign import ScanSource

FIRST_CELL_M = 0.025
"""Edge of the cells at the start, metres; doubled while the campaign fills more of them than may be kept."""
FARTHEST_M = 1e5
"""Returns further from their station, and those that are not finite, are left out."""
NEIGHBOURS = 12
"""Returns from which a normal is made: the fewest that still tell an edge from a face under millimetre noise."""
FLATNESS = 0.02
"""Largest share of a neighbourhood's variance across its plane: a right-angled edge has 0.1 and more, a face with 2 mm
noise over 10 cm 0.001."""
LINE_SHARE = 0.05
"""Least share of variance along the second axis: below it the neighbours lie in one scan line and fix no plane."""
WIDEST_M = 0.6
"""Largest distance of the farthest neighbour, metres; a wider neighbourhood seldom lies on one face."""
MAX_INCIDENCE_COS = 0.17
"""Least cosine of incidence (80 degrees): flatter returns are stretched along the face and carry mixed pixels."""


@dataclass(frozen=True)
class ReturnSubset:
    """Chosen returns, in an order that is random but depends on the returns alone: any prefix is well spread too."""

    position: NDArray[np.float64]
    """(N, 3) metres, scan frame."""
    normal: NDArray[np.float64]
    """(N, 3) unit normals of the scanned surface, turned to the station; zero where the neighbours lie on no plane."""
    station: NDArray[np.int32]
    """(N,) index into ``station_position``; stations at the same place, to the millimetre, are the first of them."""
    station_position: NDArray[np.float64]
    """(S, 3) metres, scan frame."""
    known: NDArray[np.bool_]
    """(S,) False where the file names no scanner position, so that the side of a normal is open."""
    cell: float
    """Edge of the cells of which each gave one return, metres."""

    def __len__(self) -> int:
        return len(self.station)

    @property
    def flat(self) -> NDArray[np.bool_]:
        """(N,) the return has a normal."""
        return np.einsum("ij,ij->i", self.normal, self.normal) > 0.5


def choose_returns(
    source: ScanSource, *, most: int = 200_000, seed: int = 0, progress: Progress | None = None
) -> ReturnSubset:
    """One return from each occupied cell of each station, at most ``most`` of them.

    The cells are cubes about the station. Of the returns in a cell the one with the smallest hash is kept, and cells
    are doubled while they are too many; both are independent of the order, the blocks and the files in which returns
    come. Raises BimVerifyError when the source holds no returns.
    """
    progress = progress or Progress()
    stations = source.stations
    place = np.array([s.position for s in stations], dtype=np.float64).reshape(-1, 3)
    name = _station_hash(place, seed)
    size = 1 << int(np.ceil(np.log2(max(most, 16) * 2.5)))
    table = _empty_table(size)
    cell, filled, done = FIRST_CELL_M, 0, 0
    for block in source.blocks():
        offsets = np.ascontiguousarray(block.offsets, dtype=np.float64)
        begin = 0
        while begin < len(offsets):
            begin, filled = _insert(*table, offsets, begin, block.station, name[block.station], cell, filled, most)
            while filled > most:
                cell *= 2.0
                keep = table[3] >= 0
                kept_offsets, kept_station = table[2][keep], table[3][keep]
                table = _empty_table(size)
                filled = _reinsert(*table, kept_offsets, kept_station, name, cell, size)
        done += len(offsets)
        progress.update(0.8 * done / max(source.point_count, 1), "Choosing returns for the alignment")
    _, first, same = np.unique(name, return_index=True, return_inverse=True)
    keep = table[3] >= 0
    if not keep.any():
        raise BimVerifyError(f"{', '.join(source.paths) or 'The scan'} holds no returns. Give a scan with points.")
    order = np.argsort(table[0][keep], kind="stable")
    offsets, station = table[2][keep][order], first[same][table[3][keep][order]].astype(np.int32)
    normal = np.zeros_like(offsets)
    for s in range(len(stations)):
        own = np.flatnonzero(station == s)
        normal[own] = _normals(offsets[own], stations[s].known)
        progress.update(0.8 + 0.2 * (s + 1) / len(stations), "Normals of the chosen returns")
    return ReturnSubset(
        position=place[station] + offsets,
        normal=normal,
        station=station,
        station_position=place,
        known=np.array([s.known for s in stations], dtype=np.bool_),
        cell=cell,
    )


def _empty_table(size: int) -> tuple[NDArray[np.uint64], NDArray[np.uint64], NDArray[np.float64], NDArray[np.int32]]:
    return (
        np.zeros(size, np.uint64),
        np.zeros(size, np.uint64),
        np.zeros((size, 3), np.float64),
        np.full(size, -1, np.int32),
    )


def _station_hash(place: NDArray[np.float64], seed: int) -> NDArray[np.uint64]:
    """A number per station from its position to the millimetre: the same station in two files is one."""
    grid = np.round(place * 1000.0).astype(np.int64)
    out = np.full(len(place), np.uint64(seed & 0xFFFFFFFF), dtype=np.uint64)
    for axis in range(3):
        out = _mix_array(out ^ grid[:, axis].view(np.uint64))
    return out


@njit(cache=True, nogil=True)
def _mix(x: np.uint64) -> np.uint64:
    """Finaliser of SplitMix64 (Steele, Lea and Flood 2014)."""
    x = np.uint64(x + np.uint64(0x9E3779B97F4A7C15))
    x = np.uint64((x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9))
    x = np.uint64((x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB))
    return np.uint64(x ^ (x >> np.uint64(31)))


@njit(cache=True, nogil=True)
def _mix_array(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    out = np.empty_like(values)
    for i in range(len(values)):
        out[i] = _mix(values[i])
    return out


@njit(cache=True, nogil=True)
def _put(keys, hashes, kept, owner, x, y, z, bits, station, station_name, cell):  # type: ignore[no-untyped-def]
    """Offer one return to the table; 1 when it opened a new cell."""
    key = station_name
    key = _mix(key ^ np.uint64(np.int64(np.floor(x / cell))))
    key = _mix(key ^ np.uint64(np.int64(np.floor(y / cell))))
    key = _mix(key ^ np.uint64(np.int64(np.floor(z / cell))))
    own = _mix(_mix(_mix(station_name ^ bits[0]) ^ bits[1]) ^ bits[2])
    mask = np.uint64(len(keys) - 1)
    slot = np.int64(key & mask)
    while owner[slot] >= 0 and keys[slot] != key:
        slot = np.int64(np.uint64(slot + 1) & mask)
    new = owner[slot] < 0
    if new or own < hashes[slot]:
        keys[slot] = key
        hashes[slot] = own
        kept[slot, 0], kept[slot, 1], kept[slot, 2] = x, y, z
        owner[slot] = station
    return 1 if new else 0


@njit(cache=True, nogil=True)
def _insert(keys, hashes, kept, owner, offsets, begin, station, station_name, cell, filled, most):  # type: ignore[no-untyped-def]
    """Offer returns from ``begin`` on until more than ``most`` cells are filled; where it stopped, and the cells
    filled."""
    bits = offsets.view(np.uint64)
    for i in range(begin, len(offsets)):
        x, y, z = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        if not (abs(x) < FARTHEST_M and abs(y) < FARTHEST_M and abs(z) < FARTHEST_M):
            continue
        filled += _put(keys, hashes, kept, owner, x, y, z, bits[i], station, station_name, cell)
        if filled > most:
            return i + 1, filled
    return len(offsets), filled


@njit(cache=True, nogil=True)
def _reinsert(keys, hashes, kept, owner, offsets, station, names, cell, most):  # type: ignore[no-untyped-def]
    bits = offsets.view(np.uint64)
    filled = 0
    for i in range(len(offsets)):
        s = station[i]
        filled += _put(
            keys, hashes, kept, owner, offsets[i, 0], offsets[i, 1], offsets[i, 2], bits[i], s, names[s], cell
        )
    return filled


def _normals(offsets: NDArray[np.float64], known: bool) -> NDArray[np.float64]:
    """(N, 3) normals of one station's returns, turned to the station at the origin; zero where there is no plane."""
    normal = np.zeros_like(offsets)
    if len(offsets) < NEIGHBOURS:
        return normal
    tree = cKDTree(offsets, balanced_tree=False, compact_nodes=False)
    for begin in range(0, len(offsets), 50_000):
        part = slice(begin, begin + 50_000)
        distance, index = tree.query(offsets[part], NEIGHBOURS, workers=-1)
        near = offsets[index]
        near = near - near.mean(axis=1, keepdims=True)
        spread, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
        found = axes[:, :, 0]
        total = np.maximum(spread.sum(axis=1), 1e-12)
        flat = (spread[:, 0] < FLATNESS * total) & (spread[:, 1] > LINE_SHARE * total) & (distance[:, -1] < WIDEST_M)
        if known:
            length = np.maximum(np.linalg.norm(offsets[part], axis=1), 1e-9)
            cosine = np.einsum("ij,ij->i", found, -offsets[part]) / length
            found = found * np.where(cosine < 0, -1.0, 1.0)[:, None]
            flat &= np.abs(cosine) > MAX_INCIDENCE_COS
        normal[part] = np.where(flat[:, None], found, 0.0)
    return normal
