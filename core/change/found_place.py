"""Is what was found at another place the element, or a neighbour that stands as planned and that the element covered?

Without a column in the corner of two walls their faces behind it are seen, and may lie where some place near the planned one
has the column's faces. Where two faces touch, a ray through the planned model meets one of them, so this is asked of the
neighbours' faces themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..evidence.collect import Queries
from ..evidence.decide import Context, Place, assess_place, choose
from ..evidence.own_evidence import TOLD_APART_SIGMAS
from ..evidence.probe import probe
from ..evidence.rival import fits_beyond_chance
from ..evidence.scenery import AsBuilt, Scenery, with_glass
from ..evidence.shared_surface import on_others
from ..evidence.sightings import AT, GRAZE
from ..evidence.verify import MOST_REFINEMENTS, REFINE_M, Findings
from ..model.parts import Parts
from ..model.samples import SurfaceSamples
from ..progress import Progress


def without_neighbours(
    scenery: Scenery, samples: SurfaceSamples, plans: Sequence[Place], best: Sequence[Place], context: Context, parts: Parts
) -> list[Place]:
    """The ``best`` places, but the plan where a place fits no more than by chance without the returns that lie on faces of
    neighbours that stand as planned.

    Places with what tells of the plan (slides) are left as they are. ``samples`` with those that what is missing uncovered.
    """
    moved = [e for e, place in enumerate(best) if place is not plans[e] and place.at != plans[e].at]
    as_built = AsBuilt.of(scenery.model, list(plans), list(best), context) if moved else None
    if as_built is None:
        return list(best)
    first = samples.first_of(len(plans))
    rows = [np.arange(first[e], first[e + 1])[samples.exposed[first[e] : first[e + 1]]] for e in moved]
    row = np.concatenate(rows)
    shift = np.repeat(np.array([best[e].fit.vector for e in moved]), [len(r) for r in rows], axis=0)
    seen = scenery.look(
        Queries(row, samples.position[row] + shift, samples.normal[row], samples.element[row], samples.triangle[row], shift),
        Progress(),
    )
    element = samples.element[seen.sample]
    seen = scenery.explain(seen, seen.on_face, element, as_built, np.ones(len(seen), np.bool_))
    seen = with_glass(scenery, seen, samples.triangle[seen.sample], context.see_through)
    there = np.flatnonzero(seen.on_face & (seen.state(context.window) == AT))
    there = there[np.argsort(element[there], kind="stable")]
    point = seen.point[there].astype(np.float64)
    back = scenery.origins(seen)[there] - point
    back /= np.maximum(np.linalg.norm(back, axis=1, keepdims=True), 1e-9)
    near = TOLD_APART_SIGMAS * context.sigma
    pair, other, _ = on_others(scenery.model, scenery.surfaces, point, back, element[there], near, parts, GRAZE)
    others = np.zeros(len(seen), np.bool_)
    others[there[pair[_stands(plans, best, context)[other]]]] = True
    places = list(best)
    for e in moved:
        whole, own = (
            assess_place(best[e].fit.vector, part, samples.area[part.sample], best[e].exposed, context)
            for part in (seen.rows((element == e) & of) for of in (True, ~others))
        )
        if not fits_beyond_chance(own.at / max(whole.at + whole.beyond, 1e-12), whole.rays, context):
            places[e] = plans[e]
    return places


def nearer_places(scenery: Scenery, found: Findings, context: Context) -> list[Place]:
    """The ``found`` best places, with those of elements whose faces proposed none that explains half of them, where the fit at
    the one that explains most leads to one that does.

    Each facet of a pile that moved sideways proposes a place of its own, all of them off: what it shows is the shift along its
    normal.
    """
    near = {}
    for e, tried in found.tried.items():
        plan, most = found.plans[e], max(tried, key=lambda place: place.at)
        if found.best[e] is plan and plan.share < context.thresholds.present_share and most.at > plan.at:
            near[e] = most
    if not near:
        return found.best
    scenery = replace(scenery, samples=found.samples)
    as_built = AsBuilt.of(scenery.model, found.plans, found.best, context)
    best, open_ = list(found.best), set(near)
    for _ in range(MOST_REFINEMENTS):
        off = [(e, near[e].fit.vector) for e in sorted(open_)]
        off = [(e, shift) for e, shift in off if np.linalg.norm(shift - near[e].shift) > REFINE_M]
        probed = probe(scenery, off, as_built, context, Progress())
        open_ = {e for e, places in probed.items() if places[0].at > near[e].at}
        near |= {e: probed[e][0] for e in open_}
    for e, place in near.items():
        best[e] = choose(found.plans[e], [place], context)
    return best


def _stands(plans: Sequence[Place], best: Sequence[Place], context: Context) -> NDArray[np.bool_]:
    """(E,) elements that were found at their planned place."""
    present = context.thresholds.present_share
    return np.array([b is p and p.at > 0 and p.share >= present for p, b in zip(plans, best, strict=True)])
