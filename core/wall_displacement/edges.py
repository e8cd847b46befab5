"""Where a joint's edge lies: a ramp from face to recess fitted to samples of both, and how well the samples fix it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .epoch import spread_rows

Array = NDArray[np.float64]
RAMPS_M = (0.0, 0.003, 0.006, 0.01, 0.015, 0.02, 0.03)
STEP_M = 0.0002
BLOCKS = 8
MOST_SAMPLES = 12_000


@dataclass(frozen=True)
class Samples:
    """Heights v (N,) [m] at which rays cross the face, recess q (N,) in 0..1, and the place x (N,) along the joint.

    The recess rises with v; for an upper edge both are mirrored.
    """

    v: Array
    q: Array
    x: Array


@dataclass(frozen=True)
class Edge:
    """Height of the middle of the ramp [m], and its standard deviation."""

    at: float
    sigma: float


@njit(cache=True, nogil=True)
def _costs(places, ramp, v, q, weight):  # type: ignore[no-untyped-def]
    """Sum of |recess - ramp| for each place; ``v`` ascending, so that only samples on the ramp need a look."""
    before = np.zeros(v.size + 1)  # cost of all samples to the left, where the ramp is 0
    after = np.zeros(v.size + 1)  # of all to the right, where it is 1
    for i in range(v.size):
        before[i + 1] = before[i] + weight[i] * abs(q[i])
        after[i + 1] = after[i] + weight[i] * abs(q[i] - 1.0)
    out = np.zeros(places.size)
    for k in range(places.size):
        low = np.searchsorted(v, places[k] - 0.5 * ramp, side="right")
        high = np.searchsorted(v, places[k] + 0.5 * ramp, side="right")
        total = before[low] + after[v.size] - after[high]
        for i in range(low, high):
            total += weight[i] * abs(q[i] - ((v[i] - places[k]) / ramp + 0.5))
        out[k] = total
    return out


def fit_edges(epochs: list[Samples], low: float, high: float) -> list[Edge]:
    """One edge per epoch, the ramp's width shared between them; edges are looked for from ``low`` to ``high`` [m]."""
    epochs = [_thinned(e) for e in epochs]
    places = np.arange(low, high + STEP_M, STEP_M)
    best: tuple[float, float, list[Array]] | None = None
    for ramp in RAMPS_M:
        costs = [_costs(places, ramp, e.v, e.q, np.ones(len(e.v))) for e in epochs]
        total = sum(float(c.min()) / max(len(e.v), 1) for c, e in zip(costs, epochs, strict=True))
        if best is None or total < best[0] - 1e-9:
            best = (total, ramp, costs)
    assert best is not None
    _, ramp, costs = best
    return [_edge(e, places, c, ramp) for e, c in zip(epochs, costs, strict=True)]


def _edge(samples: Samples, places: Array, cost: Array, ramp: float) -> Edge:
    at = _middle(places, cost)
    near = np.arange(at - 0.008, at + 0.008 + 1e-9, STEP_M)
    rank = np.empty(len(samples.x), np.int64)
    rank[np.argsort(samples.x, kind="stable")] = np.arange(len(rank))
    block = rank * BLOCKS // max(len(rank), 1)
    without = []
    for k in range(BLOCKS):
        weight = (block != k).astype(np.float64)
        without.append(_middle(near, _costs(near, ramp, samples.v, samples.q, weight)))
    spread = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((np.array(without) - np.mean(without)) ** 2))
    below, above = samples.v[samples.q < 0.5], samples.v[samples.q >= 0.5]
    under = below[below <= at]
    over = above[above >= at]
    gap = (over.min() if len(over) else at + 0.05) - (under.max() if len(under) else at - 0.05)
    return Edge(at, float(np.sqrt(spread**2 + (max(gap, 0.0) ** 2 + STEP_M**2) / 12.0)))


def _middle(places: Array, cost: Array) -> float:
    """The middle of the places that fit equally well."""
    least = np.flatnonzero(cost <= cost.min() + 1e-9)
    return float(0.5 * (places[least[0]] + places[least[-1]]))


def _thinned(samples: Samples) -> Samples:
    """At most so many samples as the fit needs, by ascending v."""
    rows = spread_rows(len(samples.v), MOST_SAMPLES)
    rows = rows[np.argsort(samples.v[rows], kind="stable")]
    return Samples(samples.v[rows], samples.q[rows], samples.x[rows])
