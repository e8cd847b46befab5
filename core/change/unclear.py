"""Returns that tell nothing of the element at whose place, or just behind which, they lie.

A beam that meets the edge of one thing and then another returns a range in between: a return in the air, which may lie where a
third thing was planned. And of two surfaces closer together than the sensor tells apart, one shows nothing of the other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..evidence.as_found import reassessed
from ..evidence.decide import Context
from ..evidence.own_evidence import TOLD_APART_SIGMAS, Touching, beam_radius, four_sides, from_edges, may_be_half
from ..evidence.scenery import Scenery
from ..evidence.sightings import AT, BEYOND, Sightings
from ..evidence.verify import Findings
from ..model.parts import Parts
from ..model.raycast import RayScene
from ..model.samples import SurfaceSamples


def without_unclear(scenery: Scenery, found: Findings, tolerance: float, context: Context) -> Findings:
    """The same, where neither what another surface just behind an element's own sent back, nor what an edge did, tells of it.

    Edges are asked of elements that seem to stand off their place by more than ``tolerance`` [m] within the window.
    """
    samples, seen, count = found.samples, found.seen, len(found.plans)
    apart = (TOLD_APART_SIGMAS + 1.0) * context.sigma
    state = seen.state(context.window)
    behind = np.flatnonzero(seen.on_face & (state == BEYOND) & seen.explained & (seen.deviation >= -apart))
    off = np.array([
        best is plan and np.linalg.norm(plan.fit.vector) > tolerance
        for plan, best in zip(found.plans, found.best, strict=True)
    ])
    element = samples.element[seen.sample]
    at = seen.on_face & (state == AT) & off[element]
    edge = from_edges(seen, samples, scenery.surfaces, at, context.sigma, count)
    seen = seen.beside(np.concatenate([behind, edge]))
    return reassessed(replace(found, seen=seen), np.unique(element[edge]), context)


def split_beams(
    seen: Sightings, asked: NDArray[np.bool_], samples: SurfaceSamples, origins: NDArray[np.float64], scene: RayScene,
    sigma: float, registration_sigma: float, parts: Parts,
) -> Touching:
    """Returns, of those ``asked`` for (M,), of beams of which a part meets another element as planned before they return.

    Only of elements of which half of such returns may be like that: a few at the border of a standing one are its own.
    ``origins`` (M, 3) of the rays, metres, local frame.
    """
    row = np.flatnonzero(asked & (seen.station >= 0))
    ray = seen.point[row].astype(np.float64) - origins[row]
    length = np.linalg.norm(ray, axis=1)
    ray /= np.maximum(length, 1e-9)[:, None]
    reach = np.maximum(length - (TOLD_APART_SIGMAS + 1.0) * sigma, 0.0)
    own = samples.element[seen.sample[row]].astype(np.int64)
    rows, others = [], []
    for start in four_sides(origins[row], ray, beam_radius(seen.rows(row)) + 2.0 * registration_sigma):
        _, met = scene.first_hit(start, ray, reach)
        other = np.where(met >= 0, scene.element[met], own)
        split = np.flatnonzero(other != own)
        rows.append(row[split])
        others.append(other[split])
    pair = np.unique(np.column_stack([np.concatenate(rows), np.concatenate(others)]), axis=0)
    whose = zip(samples.element[seen.sample[pair[:, 0]]].tolist(), pair[:, 1].tolist(), strict=True)
    pair = pair[np.array([(a, b) not in parts and (b, a) not in parts for a, b in whose], np.bool_)]
    of = samples.element[seen.sample]
    count, split_ = (np.bincount(of[k], minlength=int(of.max(initial=0)) + 1) for k in (row, np.unique(pair[:, 0])))
    pair = pair[may_be_half(split_, count)[of[pair[:, 0]]]]
    return Touching(pair[:, 0], pair[:, 1], np.zeros(len(pair), np.bool_))
