"""Does something stand close beside a slender element that rays passed? It may be the element, a little off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress
from .as_found import AsFound
from .decide import Context
from .passed_beside import passed_beside
from .scenery import Scenery
from .sightings import BEYOND, Sightings
from .slender import Axes
from .verify import Findings


def shares_beside(scenery: Scenery, found: Findings, context: Context, progress: Progress) -> dict[int, float]:
    """For slender elements that seem gone: of the beams that pass the planned place, the share that does so where something
    that nothing planned explains stands beside it, within the window."""
    gone = np.array([
        found.best[e] is plan and plan.share <= context.thresholds.absent_share and Axes.of(scenery, e).slender(context.window)
        for e, plan in enumerate(found.plans)
    ], np.bool_)
    if not gone.any():
        return {}
    seen, samples = found.seen, found.samples
    as_found = AsFound.of(found, samples, context)
    built = as_found.scene(scenery, found, context.window)
    beside = passed_beside(scenery, seen, samples, as_found, built, context.window, frozenset(), gone, progress)
    element = samples.element[seen.sample]
    row = np.flatnonzero(gone[element] & seen.on_face & (seen.state(context.window) == BEYOND))
    passed, aside = (_beams(seen, element, rows, len(gone)) for rows in (row, beside))
    return {e: float(aside[e] / max(passed[e], 1)) for e in np.flatnonzero(gone).tolist()}


def _beams(seen: Sightings, element: NDArray[np.int32], rows: NDArray[np.int64], elements: int) -> NDArray[np.int64]:
    """(E,) different beams among ``rows`` of each element."""
    key = np.column_stack([element[rows].astype(np.uint64), seen.ray_key(rows)])
    return np.bincount(np.unique(key, axis=0)[:, 0].astype(np.int64), minlength=elements)
