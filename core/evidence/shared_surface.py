"""Which positions of an element's open surface lie on the surface of another one too: returns there may be either one's.

Elements modelled twice, boards modelled within the wall that they formed, rafters in a roof that is modelled solid down to
their underside, a column flush with the wall around it. A whole and its parts share their surface too, but there nothing is
in doubt: what stands is both.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.on_element import PARALLEL, ElementSurfaces
from ..model.parts import Parts
from ..model.samples import SurfaceSamples

SAME_SURFACE_M = 0.002
"""Surfaces this close together, facing the same way, are one to any scanner."""
ASKED_AT_ONCE = 500_000


@dataclass(frozen=True)
class SharedSurface:
    """Pairs of a position and another element whose surface lies there too."""

    sample: NDArray[np.int64]
    """(K,) rows of the samples."""
    element: NDArray[np.int64]
    """(K,) whose they are."""
    partner: NDArray[np.int64]
    """(K,) the other element."""
    area: NDArray[np.float64]
    """(K,) m2 that the position stands for."""

    def in_doubt(self, samples: int, gone: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(samples,) whether a partner that is not known to be ``gone`` (E,) has the position too."""
        doubt = np.zeros(samples, np.bool_)
        doubt[self.sample[~gone[self.partner]]] = True
        return doubt

    def between(self, body: NDArray[np.int64]) -> SharedSurface:
        """Those between elements of which each has another ``body`` (E,)."""
        keep = body[self.element] != body[self.partner]
        return SharedSurface(self.sample[keep], self.element[keep], self.partner[keep], self.area[keep])

    def main_partner(self, row: int, gone: NDArray[np.bool_]) -> int:
        """The element, not known to be ``gone`` (E,), that has most of the open surface of ``row``; -1 where there is none."""
        of = (self.element == row) & ~gone[self.partner]
        if not of.any():
            return -1
        return int(np.argmax(np.bincount(self.partner[of], weights=self.area[of])))


def find_shared(
    model: BuildingModel, samples: SurfaceSamples, surfaces: ElementSurfaces, parts: Parts = frozenset()
) -> SharedSurface:
    """All such pairs among the exposed ``samples``; a part and its whole are none."""
    row = np.flatnonzero(samples.exposed)
    at, partner, _ = on_others(
        model, surfaces, samples.position[row], samples.normal[row], samples.element[row], SAME_SURFACE_M, parts,
    )
    sample = row[at]
    return SharedSurface(sample, samples.element[sample].astype(np.int64), partner, samples.area[sample])


def on_others(
    model: BuildingModel, surfaces: ElementSurfaces, point: NDArray[np.float64], normal: NDArray[np.float64],
    element: NDArray[np.int32], within: float, parts: Parts, cosine: float = PARALLEL,
    shift: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
    """(row, other, its triangle): points (N, 3), of ``element`` (N,) in ascending order, that lie on a face of which other one.

    The face is within ``within`` metres, its normal has at least this ``cosine`` with ``normal`` (N, 3). Asked element by
    element, since rays meet only one of two faces that lie in each other. ``shift`` (E, 3) [m] of the others from their plan.
    """
    none = np.zeros(0, np.int64)
    found, waiting = [(none, none, none.astype(np.int32))], _Waiting()
    low, high = model.element_bounds
    shift = np.zeros_like(low) if shift is None else shift
    low, high = low + shift - within, high + shift + within
    edge = np.flatnonzero(np.diff(element, prepend=-1, append=-1))

    def ask() -> None:
        row, other = np.concatenate([none, *waiting.row]), np.concatenate([none, *waiting.other])
        on = surfaces.face_at(
            point[row].astype(np.float64) - shift[other], normal[row].astype(np.float64), other.astype(np.int32),
            model.triangle_start[other].astype(np.int32), within, cosine,
        )
        found.append((row[on >= 0], other[on >= 0], on[on >= 0]))
        waiting.row, waiting.other, waiting.count = [], [], 0

    for begin, end in pairwise(edge.tolist()):
        own = int(element[begin])
        place = point[begin:end]
        for other in np.flatnonzero((low <= place.max(axis=0)).all(axis=1) & (high >= place.min(axis=0)).all(axis=1)).tolist():
            if other != own and (own, other) not in parts and (other, own) not in parts:
                waiting.add(begin + np.flatnonzero(((place >= low[other]) & (place <= high[other])).all(axis=1)), other)
        if waiting.count > ASKED_AT_ONCE:
            ask()
    ask()
    return (
        np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found]), np.concatenate([f[2] for f in found])
    )


@dataclass
class _Waiting:
    """Pairs that are to be asked together."""

    row: list[NDArray[np.int64]] = field(default_factory=list)
    other: list[NDArray[np.int64]] = field(default_factory=list)
    count: int = 0

    def add(self, row: NDArray[np.int64], other: int) -> None:
        if len(row):
            self.row.append(row)
            self.other.append(np.full(len(row), other))
            self.count += len(row)
