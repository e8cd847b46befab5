"""Good solutions of the covering problem: greedy choice, then leaving out and replacing."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from .cover import ENOUGH, Array, CoverProblem


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


def _prune(problem: CoverProblem, chosen: list[int], fixed: set[int]) -> list[int]:
    enough = np.minimum(problem.need, problem.covered(chosen)) - ENOUGH
    loose = problem.loose(chosen)
    for c in sorted(set(chosen) - fixed, key=lambda c: float(problem.weight[problem.sees[c]].sum())):
        without = [o for o in chosen if o != c]
        if (problem.covered(without) >= enough).all() and problem.loose(without) <= loose:
            chosen = without
    return chosen


def _two_by_one(problem: CoverProblem, chosen: list[int], fixed: set[int]) -> list[int] | None:
    covered = problem.covered(chosen)
    enough = np.minimum(problem.need, covered)
    loose = problem.loose(chosen)
    times = problem.sees[chosen].sum(axis=0)
    others = np.setdiff1d(np.arange(len(problem.sees)), chosen)
    free = [c for c in chosen if c not in fixed]
    for i, a in enumerate(free):
        for b in free[i + 1 :]:
            open_groups = times == problem.sees[a].astype(np.int64) + problem.sees[b]
            lost = np.flatnonzero(open_groups & (times > 0))
            lacking = enough - covered + np.bincount(
                problem.element[lost], weights=problem.weight[lost], minlength=len(enough)
            )
            rest = [o for o in chosen if o not in (a, b)]
            for c in others[_cover_lacking(problem, others, open_groups, lacking)]:
                if problem.loose([*rest, int(c)]) <= loose:
                    return [*rest, int(c)]
    return None


def _cover_lacking(
    problem: CoverProblem, places: NDArray[np.int64], open_groups: NDArray[np.bool_], lacking: Array
) -> NDArray[np.bool_]:
    """(len(places),) places each of which alone covers, of the groups that no other sees, what the elements lack."""
    short = np.flatnonzero(lacking > ENOUGH)
    row = np.full(len(lacking), -1)
    row[short] = np.arange(len(short))
    groups = np.flatnonzero(open_groups & (row[problem.element] >= 0))
    per_element = csr_array(
        (problem.weight[groups], (np.arange(len(groups)), row[problem.element[groups]])), shape=(len(groups), len(short))
    )
    gain = problem.sees[np.ix_(places, groups)].astype(np.float64) @ per_element
    return np.asarray((gain >= lacking[short] - ENOUGH).all(axis=1))
