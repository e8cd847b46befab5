"""Where did an element go that is not where it should be? A search along its faces' directions, step by step.

The deviations of what was seen at the planned place propose shifts of large faces (``hypotheses``). A post that is slimmer
than the spacing of the rays, or a thing of many small faces, shows no such pattern: its places are tried one after another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress
from .decide import Context, Place, enough_seen
from .probe import probe
from .scenery import Scenery
from .sightings import SEARCH_M, Sightings
from .slender import Axes

LEAST_RAYS = 6
"""With fewer unexplained returns around it there is nothing to find."""
PLACES_AT_ONCE = 4000
"""So that memory does not follow the number of elements."""
FINE_M = 0.1
"""So far a slender element is looked for in small steps; farther away places are no more than for any other."""
AS_GOOD = 0.75
"""Of places that explain this much of what the best one does, the nearest is the element's: balusters stand in rows."""


def unsettled(plan: Place, seen: Sightings, context: Context) -> bool:
    """Whether an element is not where it should be, while something that nothing explains was ``seen`` around it."""
    t = context.thresholds
    share = (plan.at + plan.beyond) / max(plan.exposed, 1e-12)
    if plan.share >= t.present_share and enough_seen(plan, share, t):
        return False
    strange = (np.abs(seen.deviation) <= SEARCH_M) & ~seen.explained
    return bool(np.sum(strange) >= LEAST_RAYS and len(np.unique(seen.ray_key(strange))) >= LEAST_RAYS)


def search(
    scenery: Scenery, elements: list[int], context: Context, progress: Progress
) -> dict[int, NDArray[np.float64]]:
    """For each of the ``elements``, the shift (3,) at which most of it is found, where it is found at all.

    Within the window it would have been found at its plan, unless it is so slender that it may stand beside its own outline.
    """
    found: dict[int, NDArray[np.float64]] = {}
    asked: list[tuple[int, NDArray[np.float64]]] = []
    least: dict[int, float] = {}
    for e in elements:
        axes = Axes.of(scenery, e)
        least[e] = min([context.window, *axes.steps(context.window).tolist()])
        asked += [(e, shift) for shift in _shifts(axes, context.window)]
        if len(asked) >= PLACES_AT_ONCE or e == elements[-1]:
            found |= _found(scenery, asked, least, context, progress)
            asked = []
    return found


def _found(
    scenery: Scenery, asked: list[tuple[int, NDArray[np.float64]]], least: dict[int, float], context: Context,
    progress: Progress,
) -> dict[int, NDArray[np.float64]]:
    found = {}
    for e, tried in probe(scenery, asked, None, context, progress, coarse=True, searched=True).items():
        good = [
            p for p in tried if p.share >= context.thresholds.present_share and np.linalg.norm(p.fit.vector) > least[e]
        ]
        if good:
            most = max(p.at for p in good)
            found[e] = min((p.fit.vector for p in good if p.at >= AS_GOOD * most), key=lambda v: float(np.linalg.norm(v)))
    return found


def _shifts(axes: Axes, window: float) -> list[NDArray[np.float64]]:
    """Places to try: close together up to ``FINE_M``, beyond that as far apart as puts any face within the window."""
    shifts = []
    for axis, step in zip(axes.directions, axes.steps(window), strict=True):
        fine = np.arange(1, int(FINE_M / step) + 1) * step
        rest = np.arange(1, int(SEARCH_M / (1.5 * window)) + 1) * 1.5 * window
        for length in np.concatenate([fine, rest[rest > fine.max(initial=0.0)]]):
            shifts += [length * axis, -length * axis]
    return shifts
