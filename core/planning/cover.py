"""The covering problem: the fewest linked places that cover enough of every element; heuristics, optimum, bound."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_array, csr_array

Array = NDArray[np.float64]
ENOUGH = 1e-9
LARGEST_PROOF = 40_000
"""Groups of targets beyond which no proof is tried."""


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

    def satisfied(self, chosen: Sequence[int]) -> bool:
        """Whether every element has what it needs and all chosen places are linked."""
        return bool((self.covered(chosen) >= self.need - ENOUGH).all()) and len(self.parts(chosen)) <= 1

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


def greedy(problem: CoverProblem, first: int | None = None) -> list[int]:
    """Places added one after the other, each linked to those before, by how much of what is still needed they cover.

    Every element counts the same, whatever its size. The result covers what can be covered by linked places.
    """
    chosen = [int(c) for c in problem.known]
    if first is not None:
        chosen.append(first)
    count = len(problem.need)
    scale = 1.0 / np.maximum(problem.need, 1e-12)
    while True:
        covered = problem.covered(chosen)
        lacking = np.maximum(problem.need - covered, 0.0)
        if lacking.max(initial=0.0) <= ENOUGH:
            break
        seen = problem.sees[chosen].any(axis=0) if chosen else np.zeros(len(problem.weight), np.bool_)
        open_groups = np.flatnonzero(~seen & (lacking[problem.element] > ENOUGH))
        per_element = csr_array(
            (problem.weight[open_groups], (np.arange(len(open_groups)), problem.element[open_groups])),
            shape=(len(open_groups), count),
        )
        gain = np.minimum(problem.sees[:, open_groups].astype(np.float64) @ per_element, lacking) @ scale
        gain[chosen] = 0.0
        if gain.max(initial=0.0) <= ENOUGH:
            break
        chosen += _way(problem, chosen, gain)
    return chosen


def _way(problem: CoverProblem, chosen: list[int], gain: Array) -> list[int]:
    """The best place that is linked to the chosen ones, or the shortest chain of places to one with a gain."""
    if not chosen:
        return [int(np.argmax(gain))]
    near = problem.linked[chosen].any(axis=0)
    direct = np.where(near, gain, 0.0)
    if direct.max() > ENOUGH:
        return [int(np.argmax(direct))]
    before = {int(c): -1 for c in chosen}
    queue = deque(chosen)
    while queue:
        c = queue.popleft()
        for other in np.flatnonzero(problem.linked[c]):
            o = int(other)
            if o in before:
                continue
            before[o] = c
            if gain[o] > ENOUGH:
                chain = [o]
                while before[chain[-1]] not in chosen:
                    chain.append(before[chain[-1]])
                return chain[::-1]
            queue.append(o)
    return [int(np.argmax(gain))]


def improve(problem: CoverProblem, chosen: list[int], rounds: int = 4) -> list[int]:
    """Leave out places that are not needed, then replace two by one, as long as that helps."""
    fixed = {int(c) for c in problem.known}
    chosen = _prune(problem, chosen, fixed)
    for _ in range(rounds):
        better = _two_by_one(problem, chosen, fixed)
        if better is None:
            return chosen
        chosen = _prune(problem, better, fixed)
    return chosen


def _fine(problem: CoverProblem, chosen: Sequence[int], covered_enough: Array, parts: int) -> bool:
    return bool((problem.covered(chosen) >= covered_enough - ENOUGH).all()) and len(problem.parts(chosen)) <= parts


def _prune(problem: CoverProblem, chosen: list[int], fixed: set[int]) -> list[int]:
    enough = np.minimum(problem.need, problem.covered(chosen))
    parts = max(len(problem.parts(chosen)), 1)
    for c in sorted(set(chosen) - fixed, key=lambda c: float(problem.weight[problem.sees[c]].sum())):
        without = [o for o in chosen if o != c]
        if _fine(problem, without, enough, parts):
            chosen = without
    return chosen


def _two_by_one(problem: CoverProblem, chosen: list[int], fixed: set[int]) -> list[int] | None:
    enough = np.minimum(problem.need, problem.covered(chosen))
    parts = max(len(problem.parts(chosen)), 1)
    free = [c for c in chosen if c not in fixed]
    for i, a in enumerate(free):
        for b in free[i + 1 :]:
            rest = [o for o in chosen if o not in (a, b)]
            lacking = np.maximum(enough - problem.covered(rest), 0.0)
            groups = np.flatnonzero(lacking[problem.element] > ENOUGH)
            seen = problem.sees[rest].any(axis=0) if rest else np.zeros(len(problem.weight), np.bool_)
            groups = groups[~seen[groups]]
            area = problem.sees[:, groups] @ problem.weight[groups]
            for c in np.flatnonzero(area >= lacking.sum() - ENOUGH):
                if int(c) not in chosen and _fine(problem, [*rest, int(c)], enough, parts):
                    return [*rest, int(c)]
    return None


@dataclass(frozen=True)
class Proof:
    """Of a solution: how few places could do at best."""

    chosen: list[int] | None
    """The best solution found; None where the solver found none in time."""
    least: int
    """No solution has fewer places (beside those that are there)."""
    optimal: bool


def prove(problem: CoverProblem, upper: int, seconds: float) -> Proof:
    """Solve exactly with HiGHS, adding the links as they are missed; ``upper`` is the size of a known solution."""
    places, groups = problem.sees.shape
    if not groups or groups > LARGEST_PROOF:
        return Proof(None, 1 if (problem.need > 0).any() else 0, False)
    free = np.ones(places)
    free[problem.known] = 0.0
    cover = _cover_rows(problem)
    cost = np.concatenate([free, np.zeros(groups)])
    low = np.zeros(places + groups)
    low[problem.known] = 1.0
    cuts: list[LinearConstraint] = []
    left = seconds
    least = 0
    while left > 0.2:
        start = time.perf_counter()
        found = milp(
            cost, constraints=[*cover, *cuts], bounds=Bounds(low, np.ones(places + groups)),
            integrality=np.concatenate([np.ones(places), np.zeros(groups)]), options={"time_limit": left},
        )
        left -= time.perf_counter() - start
        bound = getattr(found, "mip_dual_bound", None)
        if bound is not None and math.isfinite(bound):
            least = max(least, math.ceil(bound - 1e-6))
        if found.x is None:
            return Proof(None, least, False)
        chosen = [int(c) for c in np.flatnonzero(found.x[:places] > 0.5)]
        parts = problem.parts(chosen)
        if len(parts) <= 1 and problem.satisfied(chosen):
            size = sum(c not in problem.known for c in chosen)
            return Proof(chosen, least, size <= least)
        if found.status != 0 or least >= upper:
            return Proof(None, least, False)
        cuts += [_link_cut(problem, part, groups) for part in parts]
    return Proof(None, least, False)


def _cover_rows(problem: CoverProblem) -> list[LinearConstraint]:
    """A group is covered no more than places see it; every element's groups add up to its need."""
    places, groups = problem.sees.shape
    group, place = np.nonzero(problem.sees.T)
    rows = coo_array(
        (
            np.concatenate([np.ones(len(place)), -np.ones(groups)]),
            (np.concatenate([group, np.arange(groups)]), np.concatenate([place, places + np.arange(groups)])),
        ),
        shape=(groups, places + groups),
    )
    used = np.flatnonzero(problem.need > ENOUGH)
    of_element = coo_array(
        (problem.weight, (problem.element, places + np.arange(groups))), shape=(len(problem.need), places + groups)
    ).tocsr()[used]
    return [
        LinearConstraint(rows.tocsr(), 0.0, np.inf),
        LinearConstraint(of_element, problem.need[used] - 1e-7, np.inf),
    ]


def _link_cut(problem: CoverProblem, part: list[int], groups: int) -> LinearConstraint:
    """A part that stood alone must be linked to a place outside, or not be used as a whole."""
    places = len(problem.sees)
    row = np.zeros(places + groups)
    outside = problem.linked[part].any(axis=0)
    outside[part] = False
    row[: places][outside] = 1.0
    row[part] -= 1.0
    return LinearConstraint(row[None, :], 1.0 - len(part), np.inf)
