"""Which returns lie on a face: its edges and what touches it left out, bulges and leans kept however far they go."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

REACH_M = 0.08
"""A surface is followed so far from where its face was found."""
SMALLEST_CELL_M = 0.1
RETURNS_A_CELL = 12.0
STEP_M = 0.015
"""Between neighbouring cells a surface goes on where their middles differ by less."""
MIXED = 2.5
"""Cells that scatter more than this many times the median hold returns of two surfaces."""
LEAST_IN_CELL = 5
LEAST_SHARE = 0.05
"""Of the cells on the face: a smaller piece is something that touches it."""
EDGE_M = 0.06
"""Returns this close to a face's ends are mixed with those of its neighbours."""
NO_HOLES = np.zeros((0, 2, 2))


def surface_returns(
    at: Array, off: Array, band: float, outline: Array, holes: Array = NO_HOLES, step: float = STEP_M
) -> Flags:
    """(N,) which returns lie on the surface that begins within ``band`` of a face and goes on without a ``step``.

    ``at`` (N, 2) places on the face, ``off`` (N,) distances from it, ``outline`` (2, 2) its lower and upper ends,
    ``holes`` (K, 2, 2) those of its openings [m].
    """
    chosen = (np.abs(off) < REACH_M) & (at > outline[0] + EDGE_M).all(axis=1) & (at < outline[1] - EDGE_M).all(axis=1)
    for low, high in holes:
        chosen &= ~((at > low - EDGE_M) & (at < high + EDGE_M)).all(axis=1)
    rows = np.flatnonzero(chosen)
    if len(rows) < LEAST_IN_CELL:
        return np.zeros(len(at), dtype=np.bool_)
    flat, shape = _cells(at[rows] - outline[0])
    middle, scatter = middles(flat, off[rows], shape)
    on = np.abs(middle) < band
    if not on.any():
        return np.zeros(len(at), dtype=np.bool_)
    middle[scatter > MIXED * np.median(scatter[on])] = np.nan
    part = _of_the_surface(middle, band, step).ravel()[flat]
    out = np.zeros(len(at), dtype=np.bool_)
    out[rows] = part & (np.abs(off[rows] - middle.ravel()[flat]) < band)
    return out


def surface_pieces(at: Array, off: Array, step: float) -> NDArray[np.int64]:
    """(N,) numbers of the pieces of surface that returns lie on, each without a ``step``; -1 where there are few returns."""
    flat, shape = _cells(at - at.min(axis=0))
    middle, _ = middles(flat, off, shape)
    return np.where(np.isfinite(middle.ravel()), _pieces(middle, step), -1)[flat]


def _cells(at: Array) -> tuple[NDArray[np.int64], tuple[int, int]]:
    """(N,) cells of places from 0 on, and how many there are of them along both directions."""
    size = max(SMALLEST_CELL_M, float(np.sqrt(RETURNS_A_CELL * np.ptp(at, axis=0).prod() / len(at))))
    number = (at / size).astype(np.int64)
    shape = (int(number[:, 0].max()) + 1, int(number[:, 1].max()) + 1)
    return number[:, 0] * shape[1] + number[:, 1], shape


def middles(flat: NDArray[np.int64], off: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Median and half the distance of the quartiles of each cell; NaN with few returns."""
    order = np.lexsort((off, flat))
    values = off[order]
    count = np.bincount(flat, minlength=shape[0] * shape[1])
    first = np.cumsum(count) - count
    enough = count >= LEAST_IN_CELL
    quartiles = np.full((3, len(count)), np.nan)
    for k, share in enumerate((0.25, 0.5, 0.75)):
        quartiles[k, enough] = values[first[enough] + (share * (count[enough] - 1)).round().astype(np.int64)]
    return quartiles[1].reshape(shape), 0.5 * (quartiles[2] - quartiles[0]).reshape(shape)


def _pieces(middle: Array, step: float) -> NDArray[np.int64]:
    """Numbers of the pieces of cells that hang together without a step."""
    row = np.arange(middle.size).reshape(middle.shape)
    pairs = []
    for a, b in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        together = np.abs(middle[a] - middle[b]) < step
        pairs.append(np.stack([row[a][together], row[b][together]]))
    i, j = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(middle.size,) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _of_the_surface(middle: Array, band: float, step: float) -> Flags:
    """Cells of pieces of which much lies on the face."""
    piece, on = _pieces(middle, step), np.abs(middle.ravel()) < band
    share = np.bincount(piece, on) / on.sum()
    return np.asarray((share[piece] > LEAST_SHARE) & np.isfinite(middle.ravel())).reshape(middle.shape)
