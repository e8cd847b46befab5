"""Where did an element go that is not where it should be? A search along its faces' directions, step by step.

The deviations of what was seen at the planned place propose shifts of large faces (``hypotheses``). A post that is slimmer
than the spacing of the rays, or a thing of many small faces, shows no such pattern: its places are tried one after another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress
from .decide import Context, Place, enough_seen
from .hypotheses import face_groups
from .probe import probe
from .scenery import Scenery
from .sightings import SEARCH_M, Sightings

LEAST_RAYS = 6
"""With fewer unexplained returns around it there is nothing to find."""
ELEMENTS_AT_ONCE = 100
"""So that memory does not follow the number of elements."""
MOST_AXES = 3
SAME_AXIS = 0.97


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

    Within the window it would have been found at its plan.
    """
    found: dict[int, NDArray[np.float64]] = {}
    for start in range(0, len(elements), ELEMENTS_AT_ONCE):
        part = elements[start : start + ELEMENTS_AT_ONCE]
        asked = [(e, shift) for e in part for shift in _steps(scenery, e, context.window)]
        for e, tried in probe(scenery, asked, None, context, progress, coarse=True, searched=True).items():
            good = [
                p for p in tried
                if p.share >= context.thresholds.present_share and np.linalg.norm(p.fit.vector) > context.window
            ]
            if good:
                found[e] = max(good, key=lambda p: p.at).fit.vector
    return found


def _steps(scenery: Scenery, e: int, window: float) -> list[NDArray[np.float64]]:
    """Shifts along the main axes of element ``e``'s faces, so close that one of them puts any face within the window."""
    triangle = slice(*scenery.model.triangle_start[[e, e + 1]])
    corner, normal = scenery.surfaces.corner[triangle], scenery.surfaces.normal[triangle]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    axes: list[NDArray[np.float64]] = []
    for direction in face_groups(normal, area)[1]:
        if all(abs(float(direction @ axis)) < SAME_AXIS for axis in axes):
            axes.append(direction)
    count = int(SEARCH_M / (1.5 * window))
    lengths = [sign * (k + 1) * 1.5 * window for k in range(count) for sign in (1.0, -1.0)]
    return [length * axis for axis in axes[:MOST_AXES] for length in lengths]
