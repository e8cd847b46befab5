"""Where the edges of joints lie: flanks fitted to the returns of both epochs, and how well the returns fix them.

A flank is what the edge of a panel looks like in section: the face, then a slope (a chamfer; none where edges are sharp)
down to a depth, then the gap, from which returns come back at any depth beyond. A beam that meets two of them reports a
depth between, weighed by what each sends back (``flank_profile``). Slope and depth are common to the joints of a column,
whose panels come out of like moulds, and the beam's radius to both epochs; they are chosen by the likelihood of all
returns near joints.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .epoch import spread_rows

Array = NDArray[np.float64]
SLOPES = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0)
"""Height of a flank over its depth; 0: a sharp edge."""
DEPTH_STEP_M, DEEPEST_M = 0.002, 0.04
STEP_M, COARSE_STEP_M = 0.0002, 0.001
BEAM_RADII_M = (0.0, 0.002, 0.0035, 0.005, 0.007, 0.0095, 0.013)
PROFILE_STEP_M = 0.0004
AIMS_M = (0.0003, 0.0006, 0.0012, 0.002, 0.0035)
NOT_UNLIKELY = 30.0
"""Places of likelihoods below exp(-30) of the best one's add nothing to the mean; they are looked at in coarse steps only."""
LEAST_PROBABLE, MOST_FLANKS = 6.0, 8
"""Flanks that are less likely by exp(-6) are left out of how much an edge depends on its flank."""
BLOCKS = 8
BLOCK_REACH_M = 0.008
MOST_SAMPLES, ENOUGH_FOR_SHAPE, LEAST_FOR_SHAPE = 12_000, 3000, 100
"""Of an edge; of all edges of a column for their shape, and of each of them at least."""
CHANCE_OF_STRAY = 0.01
"""Share of returns near an edge that neither face, flank nor gap explains: of beams that meet two of them."""
LEAST_NOISE_M = 0.0005


@dataclass(frozen=True)
class Samples:
    """Heights v (N,) at which rays cross the face [m], depth (N,) of their returns behind it [m], place x (N,) along the joint.

    The recess lies on the side of larger v; for an upper edge heights are mirrored.
    """

    v: Array
    depth: Array
    x: Array
    rise: float
    """Of the rays: change of v per metre of depth."""
    lean: float
    """Of the face: change of its depth y per metre of v. A flank turns with its panel."""
    noise: float
    """Mean absolute distance of the face's own returns from it [m]."""
    relief: float
    """Deepest relief of the face [m]."""
    rough: float
    """Share of the face's returns that lie in relief."""
    deepest: float
    """How far behind the face beams go that enter the gap [m]."""
    level_sigma: float = 0.0
    """Standard deviation of the face's depth [m]."""


@dataclass(frozen=True)
class Flank:
    """Depth [m] at which the slope ends, and height over depth of the slope; what blurs it."""

    depth: float
    slope: float
    beam: float = 0.0
    """Radius of the beams on the wall [m]."""
    aim: float = 0.0003
    """How far single beams meet the wall from where their angles say, and edges lie off a straight line [m]."""


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


def choose_flank(samples: Sequence[Samples], low: float, high: float) -> Flanks:
    """The flanks under which the samples of all edges are likely; edges are looked for from ``low`` to ``high`` [m]."""
    thinned = [_thinned(s, max(ENOUGH_FOR_SHAPE // max(len(samples), 1), LEAST_FOR_SHAPE)) for s in samples]
    places = np.arange(low, high + COARSE_STEP_M, COARSE_STEP_M)
    shallowest = max((s.relief for s in thinned), default=0.004)
    depths = np.arange(shallowest, max(DEEPEST_M, shallowest) + 1e-9, DEPTH_STEP_M)
    known: dict[Flank, float] = {}

    def likeliest(flanks: Sequence[Flank]) -> Flank:
        for flank in flanks:
            if flank not in known:
                known[flank] = sum(_unlikeliness(places, flank, s) for s in thinned)
        least = min(known[f] for f in flanks)
        return next(f for f in flanks if known[f] <= least + 1e-9)

    best = likeliest([Flank(float(d), s) for d in depths[::2] for s in SLOPES])
    # the blur hides the corners: slope and depth anew under it
    for _ in range(2):
        best = likeliest([replace(best, beam=r, aim=a) for r in BEAM_RADII_M for a in AIMS_M])
        row = SLOPES.index(best.slope)
        near = [float(d) for d in depths if abs(d - best.depth) < 2.5 * DEPTH_STEP_M]
        best = likeliest([best, *(replace(best, depth=d, slope=s) for d in near for s in SLOPES[max(row - 2, 0) : row + 3])])
    others = sorted((f for f in known if f != best and known[f] < known[best] + LEAST_PROBABLE), key=lambda f: known[f])
    chosen = tuple(others[:MOST_FLANKS])
    weight = np.exp([known[best] - known[f] for f in (best, *chosen)])
    return Flanks(best, chosen, weight / weight.sum())


def _unlikeliness(places: Array, flank: Flank, samples: Samples) -> float:
    """Negative log of the likelihood of one edge's samples, all places being equally likely."""
    cost = _cost_of(places, flank, samples)
    least = float(cost.min())
    return least - math.log(float(np.mean(np.exp(least - cost))))


def fit_edges(samples: Sequence[Samples], flanks: Flanks, low: float, high: float) -> list[Edge]:
    """The edges of a column, each looked for from ``low`` to ``high`` [m].

    The spread of a likelihood holds if its returns are independent and as the flank says. How far that is from true is
    alike for all edges of a column: the ratio of the jackknife's variance to the likelihood's, in the mean of all of them.
    """
    found = [_fit_edge(s, flanks, low, high) for s in samples]
    if not found:
        return []
    step = STEP_M**2 / 12.0
    ratio = max(float(np.mean([jackknife**2 / (own**2 + step) for _, own, jackknife, _, _ in found])), 1.0)
    return [Edge(at, math.sqrt(ratio * (own**2 + step) + level**2), others) for at, own, _, level, others in found]


def _fit_edge(samples: Samples, flanks: Flanks, low: float, high: float) -> tuple[float, float, float, float, Array]:
    """Mean and spread of the likelihood, the jackknife's, what the face's level adds [m], and the place under other flanks."""
    samples = _thinned(samples, MOST_SAMPLES)
    coarse = np.arange(low, high + COARSE_STEP_M, COARSE_STEP_M)
    cost = _cost_of(coarse, flanks.best, samples)
    likely = coarse[cost < cost.min() + NOT_UNLIKELY]
    places = np.arange(low, high + STEP_M, STEP_M)
    places = places[(places > likely[0] - BLOCK_REACH_M) & (places < likely[-1] + BLOCK_REACH_M)]
    rank = np.empty(len(samples.x), np.int64)
    rank[np.argsort(samples.x, kind="stable")] = np.arange(len(rank))
    block = rank * BLOCKS // max(len(rank), 1)
    parts = np.stack([_cost_of(places, flanks.best, _rows_of(samples, block == k)) for k in range(BLOCKS)])
    whole = parts.sum(axis=0)
    at, own = _moments(places, whole)
    near = np.abs(places - at) <= BLOCK_REACH_M
    without = [_moments(places[near], (whole - part)[near])[0] for part in parts]
    spread = float(np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((np.array(without) - np.mean(without)) ** 2)))
    # where the face lies is not known better than its line
    off = samples.level_sigma
    moved = replace(samples, depth=samples.depth + off, v=samples.v + samples.rise * off)
    by_level = _moments(places, _cost_of(places, flanks.best, moved))[0] - at if off > 0 else 0.0
    others = [_moments(places, _cost_of(places, flank, samples))[0] for flank in flanks.others]
    return at, own, spread, by_level, np.array(others)


def _cost_of(places: Array, flank: Flank, samples: Samples) -> Array:
    return np.asarray(
        _costs(
            places, flank.slope, flank.depth, flank.beam, flank.aim, samples.rise - samples.lean, samples.v,
            samples.depth, samples.noise, samples.relief, samples.rough, samples.deepest,
        )
    )


@njit(cache=True, nogil=True)
def flank_profile(slope, deep, beam, rise, deepest):  # type: ignore[no-untyped-def]
    """Depths that beams report at heights from ``-beam`` on, ``PROFILE_STEP_M`` apart; rays climb by ``rise`` a depth.

    Within a beam all surfaces count by the beam's power there (a normal distribution, its radius two standard deviations)
    and by the cosine of incidence: the face, the slope, the side of the panel where rays see it, and the back of the gap.
    """
    height = max((slope - rise) * deep, 0.0) if slope > 0 else 0.0
    first = deep if slope > 0 else 0.0
    side = max(-rise, 0.0)
    count = int((height + 2.0 * beam) / PROFILE_STEP_M) + 2
    out = np.empty(count)
    reach = int(beam / PROFILE_STEP_M)
    on_slope = (slope - rise) / math.sqrt(1.0 + (slope - rise) ** 2)
    on_side = side / math.sqrt(1.0 + side**2)
    for k in range(count):
        total, mean = 0.0, 0.0
        for j in range(-reach, reach + 1):
            t = (k + j) * PROFILE_STEP_M - beam
            if t < 0.0:
                depth, shade = 0.0, 1.0
            elif t < height:
                depth, shade = t / (slope - rise), on_slope
            elif side > 0.0 and first + (t - height) / side < deepest:
                depth, shade = first + (t - height) / side, on_side
            else:
                depth, shade = deepest, 1.0
            power = shade * math.exp(-2.0 * (j * PROFILE_STEP_M / max(beam, PROFILE_STEP_M)) ** 2)
            total, mean = total + power, mean + power * depth
        out[k] = mean / total
    return out


@njit(cache=True, nogil=True)
def _costs(places, slope, deep, beam, aim, rise, v, depth, noise, relief, rough, deepest):  # type: ignore[no-untyped-def]
    """Negative log likelihood of the depths for each place of the corner; ``v`` ascending.

    On the face: Laplace noise, relief of the face, strays. Near the edge the same about what beams report there. In the
    gap: any depth from ``deep`` to as far as beams go.
    """
    # rays that climb away from the slope see less of it
    height = max((slope - rise) * deep, 0.0) if slope > 0 else 0.0
    profile = flank_profile(slope, deep, beam, rise, deepest)
    reach = max(deepest, deep) + 0.02
    known = 1.0 - rough - CHANCE_OF_STRAY
    log_noise = math.log(2.0 * noise / known)
    log_relief = math.log(max(relief, noise) / max(rough, 1e-9))
    log_stray = math.log(reach / CHANCE_OF_STRAY)
    log_gap = math.log(max(reach - deep, 1e-3))
    size = v.size
    before = np.zeros(size + 1)  # cost of all samples to the left, on the face
    after = np.zeros(size + 1)  # in the gap
    for i in range(size):
        on_face = min(abs(depth[i]) / noise + log_noise, log_stray)
        if 0.0 <= depth[i] <= relief:
            on_face = min(on_face, log_relief)
        in_gap = min(max(deep - depth[i], 0.0) / noise + log_gap, log_stray)
        before[i + 1] = before[i] + on_face
        after[i + 1] = after[i] + in_gap
    out = np.zeros(places.size)
    for k in range(places.size):
        low = np.searchsorted(v, places[k] - beam, side="right")
        high = np.searchsorted(v, places[k] + height + beam, side="right")
        total = before[low] + after[size] - after[high]
        for i in range(low, high):
            at = (v[i] - places[k] + beam) / PROFILE_STEP_M
            cell = min(int(at), profile.size - 2)
            steep = profile[cell + 1] - profile[cell]
            behind = depth[i] - profile[cell] - (at - cell) * steep
            wide = noise + aim / PROFILE_STEP_M * abs(steep)
            own = min(abs(behind) / wide + math.log(2.0 * wide / known), log_stray)
            if 0.0 <= behind <= relief:
                own = min(own, log_relief)
            if v[i] > places[k] + height:
                own = min(own, max(deep - depth[i], 0.0) / noise + log_gap + math.log(2.0))
            total += own
        out[k] = total
    return out


def _moments(places: Array, cost: Array) -> tuple[float, float]:
    """Mean and standard deviation of the place, all being equally likely beforehand."""
    weight = np.exp(cost.min() - cost)
    weight /= weight.sum()
    mean = float(np.dot(weight, places))
    return mean, math.sqrt(float(np.dot(weight, (places - mean) ** 2)))


def _thinned(samples: Samples, most: int) -> Samples:
    """At most so many samples as needed, by ascending v."""
    rows = spread_rows(len(samples.v), most)
    return _rows_of(samples, rows[np.argsort(samples.v[rows], kind="stable")])


def _rows_of(samples: Samples, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Samples:
    return replace(samples, v=samples.v[rows], depth=samples.depth[rows], x=samples.x[rows])
