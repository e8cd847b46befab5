"""The numbers of a piece of surface from its query positions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..model.samples import SurfaceSamples
from .missing import CAUSES, NO_STATION, OCCLUDED, TURNED_AWAY
from .noise import OverlapResiduals
from .results import Measured
from .survey import Survey

LEAST_FREEDOM = 10


def measure(
    rows: NDArray[np.int64], samples: SurfaceSamples, found: Survey, overlap: OverlapResiduals, spacing: NDArray[np.float64]
) -> Measured:
    """The numbers over the exposed samples ``rows``, each with its area. ``spacing`` (N,) of all samples."""
    area = samples.area[rows]
    total = float(area.sum())
    state = found.best.state[rows]
    away = (state == TURNED_AWAY) | (state == NO_STATION)
    state = np.where(away, OCCLUDED, state)
    seen = rows[found.seen[rows]]
    share = np.bincount(state, weights=area, minlength=NO_STATION + 1) / max(total, 1e-12)
    median, p95 = quantiles(spacing[seen], samples.area[seen], (0.5, 0.95))
    incidence = np.arccos(np.clip(found.best.cosine[seen], 0.0, 1.0))
    incidence_median, incidence_p95 = quantiles(incidence, samples.area[seen], (0.5, 0.95))
    (distance,) = quantiles(found.best.distance[seen], samples.area[seen], (0.5,))
    (stations,) = quantiles(found.stations[seen].astype(np.float64), samples.area[seen], (0.5,))
    noise = _noise(found.square[seen], found.freedom[seen])
    if noise is None:
        noise = _noise(found.square_near[seen], found.freedom_near[seen])
    registration = overlap.between(seen)
    return Measured(
        area=total,
        coverage=float(share[0]) if total > 0 else 0.0,
        spacing=median, spacing_p95=p95,
        consistency=p95 / median if median and p95 else None,
        noise=noise, incidence_median=incidence_median, incidence_p95=incidence_p95,
        range_median=distance, stations_median=stations,
        missing={name: float(share[code]) for code, name in CAUSES.items()},
        registration=registration if math.isfinite(registration) else None,
        turned_away=float(area[away].sum()) / max(total, 1e-12),
    )


def _noise(square: NDArray[np.float64], freedom: NDArray[np.float64]) -> float | None:
    total = float(freedom.sum())
    return math.sqrt(float(square.sum()) / total) if total >= LEAST_FREEDOM else None


def quantiles(
    values: NDArray[np.float64], weight: NDArray[np.float64], shares: tuple[float, ...]
) -> tuple[float | None, ...]:
    """Weighted quantiles of the finite values; None for all where there are none."""
    known = np.isfinite(values)
    values, weight = values[known], weight[known]
    if not len(values):
        return tuple(None for _ in shares)
    order = np.argsort(values, kind="stable")
    filled = (np.cumsum(weight[order]) - 0.5 * weight[order]) / weight.sum()
    return tuple(float(v) for v in np.interp(shares, filled, values[order]))
