"""Where the edges of joints lie: flanks fitted to the returns of both epochs, and how well the returns fix them.

A flank is what the edge of a panel looks like in section: the face, then a slope (a chamfer; none where edges are sharp)
down to a depth, then the gap, from which returns come back at any depth beyond. Slope and depth are common to the joints
of a column, whose panels come out of like moulds; they are chosen by the likelihood of all its returns near joints.
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
BLOCKS = 8
BLOCK_REACH_M = 0.008
MOST_SAMPLES, ENOUGH_FOR_SHAPE = 12_000, 500
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
    noise: float
    """Mean absolute distance of the face's own returns from it [m]."""
    relief: float
    """Deepest relief of the face [m]."""
    rough: float
    """Share of the face's returns that lie in relief."""
    deepest: float
    """How far behind the face beams go that enter the gap [m]."""


@dataclass(frozen=True)
class Flank:
    """Depth [m] at which the slope ends, and height over depth of the slope."""

    depth: float
    slope: float


@dataclass(frozen=True)
class Edge:
    """Height of the edge's front corner [m], and its standard deviation."""

    at: float
    sigma: float


def choose_flank(samples: Sequence[Samples], low: float, high: float) -> Flank:
    """The flank under which the samples of all edges are most likely; edges are looked for from ``low`` to ``high`` [m]."""
    thinned = [_thinned(s, ENOUGH_FOR_SHAPE) for s in samples]
    places = np.arange(low, high + COARSE_STEP_M, COARSE_STEP_M)
    shallowest = max((s.relief for s in thinned), default=0.004)
    best, least = Flank(shallowest, 0.0), math.inf
    for depth in np.arange(shallowest, max(DEEPEST_M, shallowest) + 1e-9, DEPTH_STEP_M):
        for slope in SLOPES:
            flank = Flank(float(depth), slope)
            total = 0.0
            for one in thinned:
                cost = _cost_of(places, flank, one, np.ones(len(one.v)))
                total -= math.log(np.mean(np.exp(cost.min() - cost))) - float(cost.min())
            if total < least - 1e-9:
                best, least = flank, total
    return best


def fit_edge(samples: Samples, flank: Flank, low: float, high: float) -> Edge:
    """The edge, looked for from ``low`` to ``high`` [m]: mean and spread of its likelihood."""
    samples = _thinned(samples, MOST_SAMPLES)
    places = np.arange(low, high + STEP_M, STEP_M)
    at, own = _moments(places, _cost_of(places, flank, samples, np.ones(len(samples.v))))
    near = np.arange(at - BLOCK_REACH_M, at + BLOCK_REACH_M + 1e-9, STEP_M)
    rank = np.empty(len(samples.x), np.int64)
    rank[np.argsort(samples.x, kind="stable")] = np.arange(len(rank))
    block = rank * BLOCKS // max(len(rank), 1)
    without = [
        _moments(near, _cost_of(near, flank, samples, (block != k).astype(np.float64)))[0] for k in range(BLOCKS)
    ]
    spread = float(np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((np.array(without) - np.mean(without)) ** 2)))
    return Edge(at, math.sqrt(max(spread, own) ** 2 + STEP_M**2 / 12.0))


def _cost_of(places: Array, flank: Flank, samples: Samples, weight: Array) -> Array:
    # rays that climb away from the slope see less of it
    height = max((flank.slope - samples.rise) * flank.depth, 0.0) if flank.slope > 0 else 0.0
    reach = max(samples.deepest, flank.depth) + 0.02
    return np.asarray(
        _costs(
            places, height, flank.depth, samples.v, samples.depth, weight,
            samples.noise, samples.relief, samples.rough, reach, CHANCE_OF_STRAY,
        )
    )


@njit(cache=True, nogil=True)
def _costs(places, height, deep, v, depth, weight, noise, relief, rough, reach, stray):  # type: ignore[no-untyped-def]
    """Negative log likelihood of the depths for each place of the corner; ``v`` ascending.

    On the face and the slope: Laplace noise, relief of the face, strays. In the gap: any depth from ``deep`` to ``reach``.
    """
    log_noise = math.log(2.0 * noise / (1.0 - rough - stray))
    log_relief = math.log(max(relief, noise) / max(rough, 1e-9))
    log_stray = math.log(reach / stray)
    log_gap = math.log(max(reach - deep, 1e-3))
    size = v.size
    before = np.zeros(size + 1)  # cost of all samples to the left, on the face
    after = np.zeros(size + 1)  # in the gap
    for i in range(size):
        on_face = min(abs(depth[i]) / noise + log_noise, log_stray)
        if 0.0 <= depth[i] <= relief:
            on_face = min(on_face, log_relief)
        in_gap = min(max(deep - depth[i], 0.0) / noise + log_gap, log_stray)
        before[i + 1] = before[i] + weight[i] * on_face
        after[i + 1] = after[i] + weight[i] * in_gap
    out = np.zeros(places.size)
    for k in range(places.size):
        low = np.searchsorted(v, places[k], side="right")
        high = np.searchsorted(v, places[k] + height, side="right")
        total = before[low] + after[size] - after[high]
        for i in range(low, high):
            own = min(abs(depth[i] - deep * (v[i] - places[k]) / height) / noise + log_noise, log_stray)
            if 0.0 <= depth[i] <= relief:
                own = min(own, log_relief)
            total += weight[i] * own
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
    rows = rows[np.argsort(samples.v[rows], kind="stable")]
    return replace(samples, v=samples.v[rows], depth=samples.depth[rows], x=samples.x[rows])
