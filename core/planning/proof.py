"""How few places could do at best: the covering problem solved exactly by an integer programme (HiGHS)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_array

from .cover import ENOUGH, CoverProblem

LARGEST_PROOF = 40_000
"""Groups of targets beyond which no proof is tried."""


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
        if problem.satisfied(chosen):
            size = sum(c not in problem.known for c in chosen)
            return Proof(chosen, least, size <= least)
        apart = _apart(problem, chosen)
        if found.status != 0 or least >= upper or not apart:
            return Proof(None, least, False)
        cuts += [_link_cut(problem, part, groups) for part in apart]
    return Proof(None, least, False)


def _apart(problem: CoverProblem, chosen: list[int]) -> list[list[int]]:
    """The parts of the chosen places that could be linked to another part of their site, and are not."""
    parts = problem.parts(chosen)
    number = np.bincount([problem.site[part[0]] for part in parts])
    return [part for part in parts if number[problem.site[part[0]]] > 1]


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
