"""Could an element stand at another place? Query positions at the shifted place ask the scans."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.sample_surface import is_exposed
from ..progress import Progress
from .collect import Queries
from .decide import Context, Place, assess_place
from .outline import goes_on, ring
from .scenery import AsBuilt, Scenery, with_glass

MOST_PROBES, COARSE_PROBES = 1500, 100
"""Query positions of an element that test a shifted place: shares to a few percent, and to ten percent."""


def probe(
    scenery: Scenery, asked: list[tuple[int, NDArray[np.float64]]], as_built: AsBuilt | None, context: Context,
    progress: Progress, *, coarse: bool = False, searched: bool = False,
) -> dict[int, list[Place]]:
    """Assess the shifted places asked for; ``coarse`` with few query positions, and without asking where the surface ends.

    Places that were ``searched`` one after the other must fit better than others (``Scenery.explain``).
    """
    if not asked:
        return {}
    samples = scenery.samples
    shifts = np.array([s for _, s in asked])
    rows_of = _rows(scenery, asked, as_built, COARSE_PROBES if coarse else MOST_PROBES)
    own = [rows for rows, _ in rows_of]
    on_edge = [rows[:0] if coarse else rows for rows in own]
    around = [
        ring(samples.position[rows] + shift, samples.normal[rows], shift, scenery.ring_margin)
        for rows, shift in zip(on_edge, shifts, strict=True)
    ]
    sample = np.concatenate(own)
    size = np.array([len(r) for r in own])
    ring_size = np.array([len(p) for p, _ in around])
    ring_start = len(sample) + np.concatenate([[0], np.cumsum(ring_size)])
    start = np.concatenate([[0], np.cumsum(size)])
    ask_of = np.concatenate([np.repeat(np.arange(len(asked)), size), np.repeat(np.arange(len(asked)), ring_size)])
    queries = Queries(
        number=np.arange(len(ask_of)),
        position=np.concatenate([samples.position[sample] + shifts[ask_of[: len(sample)]], *(p for p, _ in around)]),
        normal=np.concatenate([samples.normal[sample], *(n for _, n in around)]),
        element=np.array([e for e, _ in asked], dtype=np.int32)[ask_of],
        triangle=np.concatenate([samples.triangle[sample], samples.triangle[sample[start[ask_of[len(sample) :]]]]]),
        shift=shifts[ask_of],
    )
    seen = scenery.look(queries, progress)
    on_ring = seen.sample >= len(sample)
    seen = scenery.explain(seen, seen.on_face | on_ring, queries.element[seen.sample], as_built, ~on_ring, searched)
    seen = with_glass(scenery, seen, queries.triangle[seen.sample], context.see_through)
    found: dict[int, list[Place]] = {}
    for k, (e, shift) in enumerate(asked):
        a, b = np.searchsorted(seen.sample, [start[k], start[k + 1]])
        part = seen.rows(slice(a, b))
        weight = rows_of[k][1]
        area = samples.area[sample[part.sample]] * weight
        exposed = float(samples.area[own[k]].sum()) * weight
        place = assess_place(shift, part, area, exposed, context)
        a, b = np.searchsorted(seen.sample, [ring_start[k], ring_start[k + 1]])
        if not goes_on(seen.rows(slice(a, b)), context.sigma, context.thresholds.outline_share):
            found.setdefault(e, []).append(place)
    return found


def _rows(
    scenery: Scenery, asked: list[tuple[int, NDArray[np.float64]]], as_built: AsBuilt | None, most: int
) -> list[tuple[NDArray[np.int64], float]]:
    """For each place asked for, the samples that are exposed there, and how many of them each kept one stands for.

    What is exposed by plan is taken for exposed; what is not may come into view where the element stands instead.
    """
    s = scenery.samples
    first = s.first_of(len(scenery.model.elements))
    step = [max(int(first[e + 1] - first[e]) // most, 1) for e, _ in asked]
    rows = [np.arange(first[e], first[e + 1], n) for (e, _), n in zip(asked, step, strict=True)]
    size = [len(r) for r in rows]
    row = np.concatenate(rows)
    shift = np.repeat(np.array([v for _, v in asked]), size, axis=0)
    kept = s.exposed[row]
    covered = np.flatnonzero(~kept)
    scene = scenery.scene if as_built is None else as_built.scene
    at = row[covered]
    kept[covered] = is_exposed(scenery.model, scene, s.position[at] + shift[covered], s.normal[at], s.element[at])
    ends = np.cumsum(size)[:-1]
    return [(r[k], float(n)) for r, k, n in zip(rows, np.split(kept, ends), step, strict=True)]
