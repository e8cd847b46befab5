"""Does something stand close beside a slender element that rays passed? It may be the element, a little off."""

from __future__ import annotations

import numpy as np

from .decide import Context
from .scenery import Scenery
from .sightings import BEYOND
from .slender import Axes
from .verify import Findings


def beside_shares(scenery: Scenery, found: Findings, context: Context) -> dict[int, float]:
    """For slender elements that seem gone: of the beams that tell, the share that returned from close beside the planned place
    from what no other element explains."""
    first = np.searchsorted(found.seen.sample, found.samples.first_of(len(found.plans)))
    shares = {}
    for e, plan in enumerate(found.plans):
        rows = found.seen.rows(slice(int(first[e]), int(first[e + 1])))
        if found.best[e] is not plan or plan.share > context.thresholds.absent_share or not len(rows):
            continue
        axes = Axes.of(scenery, e)
        if not axes.slender(context.window):
            continue
        offset = rows.point.astype(np.float64) - found.samples.position[rows.sample]
        longest = axes.directions[int(axes.extent.argmax())]
        offset -= (offset @ longest)[:, None] * longest
        near = np.linalg.norm(offset, axis=1) <= context.window
        element = found.samples.element[rows.sample]
        free = near & ~scenery.explain(rows, near, element, None).explained
        passed = np.unique(rows.ray_key(rows.on_face & (rows.state(context.window) == BEYOND)))
        its = np.unique(rows.ray_key(free))
        shares[e] = len(its) / max(len(np.union1d(its, passed)), 1)
    return shares
