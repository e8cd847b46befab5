"""The chosen places as set-ups: what each measures and mends, and what is to be said about them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..simulation.scanner import Scanner
from .choose import Choice
from .cover import ENOUGH, Array
from .existing import Existing, actions_of
from .goals import Goals
from .options import PlanOptions
from .results import PlanStation
from .site import Places, Site
from .targets import Targets

SAME_PLACE_M = 0.05
MOST_NAMED = 6
"""Elements named in a sentence."""


def list_set_ups(
    site: Site, existing: Existing | None, choice: Choice, sees: NDArray[np.bool_], targets: Targets, order: list[int],
    places: Places, scanner: Scanner, options: PlanOptions,
) -> Iterator[PlanStation]:
    """The set-ups in ``order`` (places), over what the places see (C, P) of the targets."""
    known = places.known
    asked = choice.problem.need[: len(site.model.elements)] > 0
    seen = existing.good.copy() if existing else np.zeros(len(targets), dtype=np.bool_)
    beams = scanner.grid.rows * scanner.grid.columns
    names = {k: existing.names[k] for k in range(known)} if existing else {}
    names |= {c: f"set-up {k + 1}" for k, c in enumerate(order)}
    for number, c in enumerate(order):
        fresh = np.flatnonzero(sees[c] & ~seen)
        seen |= sees[c]
        gained = np.bincount(targets.element[fresh], weights=targets.area[fresh], minlength=len(asked))
        position, floor = places.position[c] + site.model.origin, places.floor(site, c)
        yield PlanStation(
            name=names[c], position=(float(position[0]), float(position[1]), float(position[2])),
            floor=None if floor is None else floor + float(site.model.origin[2]),
            minutes=options.setup_minutes + beams / options.points_per_second / 60.0,
            area=float(targets.area[sees[c]].sum()), new_area=float(targets.area[fresh].sum()),
            linked_to=tuple(names[o] for o in [*range(known), *order[:number]] if choice.problem.linked[c, o]),
            actions=() if existing is None else _actions(existing, places.position[c], targets, fresh, scanner),
            for_elements=tuple(site.model.elements[e].global_id for e in np.flatnonzero((gained > 0) & asked)),
        )


def _actions(
    existing: Existing, position: Array, targets: Targets, fresh: NDArray[np.int64], scanner: Scanner
) -> tuple[str, ...]:
    away = np.linalg.norm(existing.positions - position, axis=1)
    nearest = int(np.argmin(away))
    finer = scanner.angular_step < 0.9 * float(existing.steps[nearest])
    distance = np.linalg.norm(targets.position[fresh] - position, axis=1)
    return actions_of(existing, fresh, distance, targets.area, finer, bool(away[nearest] < SAME_PLACE_M))


def warnings(site: Site, choice: Choice, goals: Goals) -> Iterator[str]:
    """What a person must know before going out."""
    out = np.flatnonzero((goals.target <= 0) & site.chosen)
    if len(out):
        named = ", ".join(site.names(out[:MOST_NAMED])) + (" and more" if len(out) > MOST_NAMED else "")
        yield (
            f"{len(out)} of the chosen elements are left out, because too little of them can be measured as required from any "
            f"place looked at: {named}."
        )
    parts = choice.problem.parts(choice.chosen)
    if len(parts) > 1:
        yield (
            f"The stations fall into {len(parts)} groups that share no surface, as rooms behind closed doors: open the doors, "
            "or register the groups to each other by targets or control points."
        )
    short = len(set(np.flatnonzero(choice.problem.covered(choice.chosen) < choice.problem.need - ENOUGH) % len(site.chosen)))
    if short:
        yield f"{short} elements keep less than asked for, because no linked place adds to them."
    if math.isinf(float(np.max(site.stands.floor, initial=0.0))):
        yield "Some places have no floor in the model below them."
    yield from site.model.skipped
