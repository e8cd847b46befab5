"""From views to the chosen places: solve, look again, and put them in the order to scan in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .cover import CoverProblem, make_problem
from .heuristics import greedy, improve
from .options import PlanOptions
from .proof import prove
from .second_look import SecondLook, Views

MOST_LOOKS = 4
"""Solutions that are looked at on a second set of points."""


@dataclass(frozen=True)
class Choice:
    """The places chosen; new ones are counted, known ones not."""

    problem: CoverProblem
    chosen: list[int]
    heuristic: int
    """Size of the heuristic's solution."""
    least: int
    """No choice has fewer."""


def choose_places(
    views: Views, look: SecondLook, linked: NDArray[np.bool_], known: int, quick: Callable[[], list[int]], options: PlanOptions
) -> Choice:
    """The fewest places, beside the first ``known`` that are there already, that cover what the views and the look ask for.

    What falls short on the second set of points joins the problem with it. The bound is that of the problem before: what
    joins can only ask for more. ``quick`` gives places to begin with.
    """
    joined = np.zeros(len(look.target), np.bool_)
    least = None
    starts: list[int | None] = [None] if known else [None, *quick()]
    for _ in range(MOST_LOOKS):
        problem = _linked_to_known(
            make_problem(views.sees, views.area, views.element, views.need, range(known), linked)
        )
        chosen, heuristic, bound = _solve(problem, starts, options)
        least = bound if least is None else least
        short = look.lacking(chosen) & ~joined
        if not short.any():
            break
        joined |= short
        views = look.join(views, short)
        starts = [None]
    return Choice(problem, chosen, heuristic, min(least or 0, sum(c >= known for c in chosen)))


def _solve(problem: CoverProblem, starts: list[int | None], options: PlanOptions) -> tuple[list[int], int, int]:
    """(places, size of the heuristic's solution, least possible size) with the new places counted."""
    tried = [improve(problem, greedy(problem, first)) for first in starts]
    best = min(tried, key=lambda c: (not problem.satisfied(c), len(c)))
    size = len(best) - len(problem.known)
    if not problem.satisfied(best):
        problem = replace(problem, need=np.minimum(problem.need, problem.covered(best)) * (1 - 1e-9))
    proof = prove(problem, size, options.solve_seconds)
    if proof.chosen is not None and len(set(proof.chosen) - set(problem.known.tolist())) <= size:
        best = proof.chosen
    final = len(set(best) - set(problem.known.tolist()))
    return best, size, min(proof.least, final)


def in_order(problem: CoverProblem, new: list[int], known: int) -> list[int]:
    """The order to scan in: each next station is linked to one before and adds most."""
    done: list[int] = list(range(known))
    left = set(new)
    order = []
    while left:
        near = [c for c in left if not done or problem.linked[c, done].any()] or list(left)
        seen = problem.sees[done].any(axis=0) if done else np.zeros(len(problem.weight), np.bool_)
        best = max(near, key=lambda c: (float(problem.weight[problem.sees[c] & ~seen].sum()), -c))
        order.append(best)
        done.append(best)
        left.discard(best)
    return order


def _linked_to_known(problem: CoverProblem) -> CoverProblem:
    """Existing stations are registered to each other, and a new one to any of them whose place it shares."""
    known = problem.known
    if not len(known):
        return problem
    linked = problem.linked.copy()
    linked[np.ix_(known, known)] = True
    return replace(problem, linked=linked)
