"""Where the edges of joints lie: flanks fitted to the returns of both epochs, and how well the returns fix them.

Slope and depth are common to the joints of a column, whose panels come out of like moulds, and the beam's radius to both
epochs; they are chosen by the likelihood of all returns near joints (``edge_section``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .edge_section import Array, Flank, Samples, cost_of, moments, rows_of, thinned, unlikeliness

SLOPES = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0)
"""Height of a flank over its depth; 0: a sharp edge."""
DEPTH_STEP_M, DEEPEST_M = 0.002, 0.04
STEP_M, COARSE_STEP_M = 0.0002, 0.001
BEAM_RADII_M = (0.0, 0.002, 0.0035, 0.005, 0.007, 0.0095, 0.013)
FINER = (0.78, 0.88, 1.13)
AIMS_M = (0.0003, 0.0006, 0.0012, 0.002, 0.0035)
NOT_UNLIKELY = 30.0
"""Places of likelihoods below exp(-30) of the best one's add nothing to the mean; they are looked at in coarse steps only."""
LEAST_PROBABLE, MOST_FLANKS, SOFTER = 3.0, 12, 20.0
"""What a flank's model lacks, neighbouring returns share: where flanks are compared, twenty returns count as one. Those less
likely by exp(-3) are left out of how much an edge depends on its flank."""
BLOCKS = 16
FEW_BLOCKS = 1.12
"""A standard deviation from 16 blocks is too small by sqrt(15/16), and 1.96 of it by the t distribution's 2.13."""
DRAWS = np.random.default_rng(0).multinomial(BLOCKS, np.full(BLOCKS, 1.0 / BLOCKS), 60).astype(np.float64)
BLOCK_REACH_M = 0.008
MOST_SAMPLES, ENOUGH_FOR_SHAPE, LEAST_FOR_SHAPE = 12_000, 3000, 100
"""Of an edge; of all edges of a column for their shape, and of each of them at least."""
LEAST_NOISE_M = 0.0005
LEAST_GAP_M, ABOUT_M = 0.002, 0.015
BACK_SEEN = 0.5
"""Returns from less deep than this share of where rays meet a panel's side come from the back of the gap."""


@dataclass(frozen=True)
class Edge:
    """Height of the edge's front corner [m], and its standard deviation when the flank is as taken."""

    at: float
    sigma: float
    others: Array
    """(K,) height of the corner [m] under other flanks."""


@dataclass(frozen=True)
class Flanks:
    """The likeliest flank, others that are not much less likely, and their probabilities (1 + K,), the best one's first."""

    best: Flank
    others: tuple[Flank, ...]
    probability: Array


def choose_flank(
    samples: Sequence[Samples], mates: Sequence[int | None], low: float, high: float
) -> tuple[Flanks, list[Samples]]:
    """The flanks under which the samples of all edges are likely, and the samples with the gaps that these give.

    Edges are looked for from ``low`` to ``high`` [m]; ``mates`` are the rows of the other edge of each one's joint.
    """
    places = np.arange(low, high + COARSE_STEP_M, COARSE_STEP_M)
    shallowest = max((s.relief for s in samples), default=0.004)
    depths = np.arange(shallowest, max(DEEPEST_M, shallowest) + 1e-9, DEPTH_STEP_M)
    few = max(ENOUGH_FOR_SHAPE // max(len(samples), 1), LEAST_FOR_SHAPE)
    part = [thinned(s, few) for s in samples]
    # what gaps are taken for depends on the flank, so edges that are sharp and those that are not are two beginnings
    begin = _with_gaps(part, mates, Flank(shallowest, 0.0, BEAM_RADII_M[3], AIMS_M[2]), places)
    found = [_shape(begin, mates, places, depths.tolist(), slopes) for slopes in (SLOPES[:1], SLOPES[1:])]
    known, gaps = min(found, key=lambda f: min(f[0].values()))
    best = min(known, key=lambda f: known[f])
    most = known[best] + SOFTER * LEAST_PROBABLE
    chosen = tuple(sorted((f for f in known if f != best and known[f] < most), key=lambda f: known[f])[:MOST_FLANKS])
    weight = np.exp([(known[best] - known[f]) / SOFTER for f in (best, *chosen)])
    seen = [replace(s, gap=g.gap) for s, g in zip((thinned(s, MOST_SAMPLES) for s in samples), gaps, strict=True)]
    seen = _with_gaps(seen, mates, best, places)
    return Flanks(best, chosen, weight / weight.sum()), seen


def _shape(
    samples: list[Samples], mates: Sequence[int | None], places: Array, depths: Sequence[float], slopes: Sequence[float]
) -> tuple[dict[Flank, float], list[Samples]]:
    """How unlikely flanks of these depths and slopes are, near the likeliest, and the samples with the gaps that it gives."""
    known: dict[Flank, float] = {}

    def likeliest(flanks: Sequence[Flank]) -> Flank:
        for flank in flanks:
            if flank not in known:
                known[flank] = sum(_unlikeliness(places, flank, s) for s in samples)
        least = min(known[f] for f in flanks)
        return next(f for f in flanks if known[f] <= least + 1e-9)

    best = likeliest([Flank(d, s, BEAM_RADII_M[3], AIMS_M[1]) for d in depths[::2] for s in slopes])
    # the blur hides the corners: slope and depth anew under it
    for _ in range(2):
        samples = _with_gaps(samples, mates, best, places)
        known.clear()
        best = likeliest([replace(best, beam=r, aim=a) for r in BEAM_RADII_M for a in AIMS_M])
        row = slopes.index(best.slope)
        near = [d for d in depths if abs(d - best.depth) < 2.5 * DEPTH_STEP_M]
        near_slopes = slopes[max(row - 2, 0) : row + 3]
        best = likeliest([best, *(replace(best, depth=d, slope=s) for d in near for s in near_slopes)])
        best = likeliest([best, *(replace(best, beam=best.beam * share) for share in FINER)])
    return known, samples


def _with_gaps(samples: list[Samples], mates: Sequence[int | None], flank: Flank, places: Array) -> list[Samples]:
    """With the height of each gap, and the depth of its back; where rays meet a panel's side first, it is the other gaps'."""
    found = [moments(places, cost_of(places, flank, s)) for s in samples]
    at = [place for place, _ in found]
    side = 2.0 * flank.slope * flank.depth
    gap = np.array([
        math.inf if mate is None else max(-at[k] - at[mate] - side, LEAST_GAP_M) for k, mate in enumerate(mates)
    ])
    rise = np.array([s.rise - s.lean for s in samples])
    # a lower panel's side is seen to the middle of the gap only
    limit = gap * np.where(rise > 0, 1.0, 0.5) / np.maximum(np.abs(rise), 1e-6)
    own = np.array([s.deepest for s in samples])
    seen = own < BACK_SEEN * limit
    common = float(np.median(own[seen])) if seen.any() else float(own.max(initial=0.0))
    deepest = np.where(seen, own, np.maximum(own, common))
    about = [(place + flank.slope * flank.depth, max(3.0 * spread, ABOUT_M)) for place, spread in found]
    return [
        replace(s, gap=float(g), deepest=float(d), about=a) for s, g, d, a in zip(samples, gap, deepest, about, strict=True)
    ]


def _unlikeliness(places: Array, flank: Flank, samples: Samples) -> float:
    """Negative log of the likelihood of one edge's samples, all places being equally likely."""
    middle, reach = samples.about
    near = places[(places > middle - reach - flank.slope * flank.depth) & (places < middle + reach)]
    return unlikeliness(near if len(near) else places, len(places), flank, samples)


def fit_edges(samples: Sequence[Samples], flanks: Flanks, low: float, high: float) -> list[Edge]:
    """The edges of a column, each looked for from ``low`` to ``high`` [m].

    The spread of a likelihood holds if its returns are independent and as the flank says; how much the place changes when
    parts of the joint's length are drawn anew (a bootstrap) holds without that. The larger one counts.
    """
    found = [_fit_edge(s, flanks, low, high) for s in samples]
    step = STEP_M**2 / 12.0
    return [
        Edge(at, math.sqrt(FEW_BLOCKS**2 * (max(own, drawn) ** 2 + step) + level**2), others)
        for at, own, drawn, level, others in found
    ]


def _fit_edge(samples: Samples, flanks: Flanks, low: float, high: float) -> tuple[float, float, float, float, Array]:
    """Mean and spread of the likelihood, the bootstrap's, what the face's level adds [m], and the place under other flanks."""
    samples = thinned(samples, MOST_SAMPLES)
    coarse = np.arange(low, min(high, max(_highest(samples, flanks.best), low)) + COARSE_STEP_M, COARSE_STEP_M)
    cost = cost_of(coarse, flanks.best, samples)
    likely = coarse[cost < cost.min() + NOT_UNLIKELY]
    places = np.arange(low, coarse[-1] + STEP_M, STEP_M)
    places = places[(places > likely[0] - BLOCK_REACH_M) & (places < likely[-1] + BLOCK_REACH_M)]
    rank = np.empty(len(samples.x), np.int64)
    rank[np.argsort(samples.x, kind="stable")] = np.arange(len(rank))
    block = rank * BLOCKS // max(len(rank), 1)
    parts = np.stack([cost_of(places, flanks.best, rows_of(samples, block == k)) for k in range(BLOCKS)])
    whole = parts.sum(axis=0)
    at, own = moments(places, whole)
    near = np.abs(places - at) <= BLOCK_REACH_M
    cost = DRAWS @ parts[:, near]
    weight = np.exp(cost.min(axis=1, keepdims=True) - cost)
    drawn = (weight @ places[near]) / weight.sum(axis=1)
    spread = float(np.std(drawn, ddof=1))
    # where the face lies is not known better than its line
    off = samples.level_sigma
    moved = replace(samples, depth=samples.depth + off, v=samples.v + samples.rise * off)
    by_level = moments(places, cost_of(places, flanks.best, moved))[0] - at if off > 0 else 0.0
    others = [moments(places, cost_of(places, flank, samples))[0] for flank in flanks.others]
    return at, own, spread, by_level, np.array(others)


def _highest(samples: Samples, flank: Flank) -> float:
    """The place of a corner can't be higher: what lies deeper than the slope came back from behind it."""
    behind = samples.v[samples.depth > flank.depth]
    height = max(flank.slope - samples.rise + samples.lean, 0.0) * flank.depth if flank.slope > 0 else 0.0
    return float(behind.max()) - height + flank.beam + 2.0 * flank.aim if len(behind) else math.inf
