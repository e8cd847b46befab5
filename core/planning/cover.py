"""The covering problem: places, what each sees, and which of them can be registered to each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]
ENOUGH = 1e-6
"""Area [m2] by which sums may differ."""


@dataclass(frozen=True)
class CoverProblem:
    """Places (C), groups of targets (G) that the same places see, and elements (E).

    A target that no place sees is in no group.
    """

    sees: NDArray[np.bool_]
    """(C, G)"""
    weight: Array
    """(G,) area."""
    element: NDArray[np.int64]
    """(G,)"""
    need: Array
    """(E,) area that must be covered; 0 where nothing is asked."""
    linked: NDArray[np.bool_]
    """(C, C) two places share enough surface to be registered to each other."""
    known: NDArray[np.int64]
    """Places that are there already and cost nothing."""

    def covered(self, chosen: Sequence[int]) -> Array:
        """(E,) area covered by the chosen places."""
        seen = self.sees[list(chosen)].any(axis=0) if len(chosen) else np.zeros(len(self.weight), np.bool_)
        return np.bincount(self.element[seen], weights=self.weight[seen], minlength=len(self.need)).astype(np.float64)

    @cached_property
    def site(self) -> NDArray[np.int64]:
        """(C,) places with the same number can be linked to each other, over other places: one site each."""
        return np.asarray(connected_components(csr_array(self.linked), directed=False)[1], dtype=np.int64)

    def satisfied(self, chosen: Sequence[int]) -> bool:
        """Whether every element has what it needs and all chosen places of a site are linked."""
        return bool((self.covered(chosen) >= self.need - ENOUGH).all()) and not self.loose(chosen)

    def loose(self, chosen: Sequence[int]) -> int:
        """How many more parts the chosen places fall into than they must: one a site, say a room behind a closed door."""
        return len(self.parts(chosen)) - len(np.unique(self.site[list(chosen)]))

    def parts(self, chosen: Sequence[int]) -> list[list[int]]:
        """The chosen places, by groups that are linked."""
        left: set[int] = {int(c) for c in chosen}
        out: list[list[int]] = []
        while left:
            queue, part = [left.pop()], []
            while queue:
                c = queue.pop()
                part.append(c)
                near = [o for o in left if self.linked[c, o]]
                left.difference_update(near)
                queue += near
            out.append(sorted(part))
        return out


def make_problem(
    sees: NDArray[np.bool_], area: Array, element: NDArray[np.int32], need: Array, known: Sequence[int],
    linked: NDArray[np.bool_],
) -> CoverProblem:
    """Group the targets (C, P) that the same places see."""
    some = np.flatnonzero(sees.any(axis=0) & (need[element] > 0))
    packed = np.packbits(sees[:, some], axis=0).T
    key = np.column_stack([packed, element[some].astype(np.int32).view(np.uint8).reshape(-1, 4)])
    key = np.ascontiguousarray(key).view([("", np.uint8)] * key.shape[1]).ravel() if len(some) else np.zeros(0, np.uint8)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    weight = np.bincount(inverse.ravel(), weights=area[some], minlength=len(first)).astype(np.float64)
    return CoverProblem(
        sees[:, some[first]], weight, element[some[first]].astype(np.int64), need, linked, np.array(known, dtype=np.int64)
    )


def shared_enough(sees: NDArray[np.bool_], area: Array, overlap: float) -> NDArray[np.bool_]:
    """(C, C) places whose views (C, P) share at least ``overlap`` of the smaller one's area."""
    common = (sees * area.astype(np.float32)) @ sees.T.astype(np.float32)
    own = np.diag(common)
    return np.asarray((common >= overlap * np.minimum(own[:, None], own[None, :])) & (common > 0))
