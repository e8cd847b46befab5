"""An existing campaign as the start of a plan: what it measures well enough already, and what each new station mends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..quality.missing import GRAZING, OCCLUDED, OUT_OF_RANGE, OUTSIDE_VIEW, SEEN, TURNED_AWAY
from ..quality.results import QualityResult
from ..simulation.scene import Prop
from .targets import Targets
from .visibility import Requirement

LEAST_SHARE = 0.1
"""A reason that stands behind less of what a station mends is not named."""
STEEP_COS = math.cos(math.radians(60.0))


@dataclass(frozen=True)
class Existing:
    """What a campaign gives for the targets (P,)."""

    good: NDArray[np.bool_]
    """Measured as required."""
    state: NDArray[np.int8]
    cosine: NDArray[np.float64]
    distance: NDArray[np.float64]
    """Of the view that sees it best, or came closest to it."""
    spacing: NDArray[np.float64]
    sigma: float
    """Of a measured position along the normal [m]."""
    names: tuple[str, ...]
    positions: NDArray[np.float64]
    """(S, 3) metres, local frame."""
    steps: NDArray[np.float64]
    """(S,) angular steps [rad]."""


def start_from(quality: QualityResult, targets: Targets, need: Requirement) -> Existing:
    """From a quality survey over the same samples that ``targets`` were taken from."""
    row = targets.row
    best, spacing = quality.survey.best, quality.survey.spacing[row]
    noise = quality.whole.noise or 0.0
    sigma = math.hypot(noise, quality.registration_sigma)
    with np.errstate(invalid="ignore"):
        good = (best.state[row] == SEEN) & (spacing <= need.spacing)
        good &= best.cosine[row] >= math.cos(need.max_incidence)
    return Existing(
        good=good & (2.0 * sigma <= need.bound), state=best.state[row], cosine=best.cosine[row], distance=best.distance[row],
        spacing=spacing, sigma=sigma, names=tuple(s.name for s in quality.stations),
        positions=np.array([s.position for s in quality.stations]).reshape(-1, 3) - quality.model.origin,
        steps=np.array([s.spacing_rad for s in quality.stations]),
    )


def clutter_props(quality: QualityResult) -> list[Prop]:
    """The things that are not in the model, as boxes that hide what is behind them from new stations too."""
    props = []
    for thing in quality.clutter:
        low, high = np.array(thing.low) - quality.model.origin, np.array(thing.high) - quality.model.origin
        size = np.maximum(high - low, 0.02)
        middle = 0.5 * (low + high)
        props.append(Prop(
            thing.name, "box", (float(middle[0]), float(middle[1]), float(middle[2])),
            (float(size[0]), float(size[1]), float(size[2])),
        ))
    return props


def actions_of(
    existing: Existing, mended: NDArray[np.int64], distance: NDArray[np.float64], area: NDArray[np.float64],
    finer: bool, same_place: bool,
) -> tuple[str, ...]:
    """Corrective actions that a station stands for: why the targets ``mended`` (K,) lacked, and what it does about it.

    ``distance`` (K,) from the new station [m].
    """
    if same_place:
        return ("IR",)
    state, weight = existing.state[mended], area[mended]
    share: dict[str, float] = {}

    def add(action: str, rows: NDArray[np.bool_]) -> None:
        share[action] = float(weight[rows].sum()) / max(float(weight.sum()), 1e-12)

    add("AO", np.isin(state, (OCCLUDED, TURNED_AWAY, OUTSIDE_VIEW)))
    steep = existing.cosine[mended] < STEEP_COS
    add("RA", (state == GRAZING) | ((state == SEEN) & steep))
    nearer = distance < 0.8 * existing.distance[mended]
    add("RD", (state == OUT_OF_RANGE) | ((state == SEEN) & ~steep & nearer))
    add("IN", (state == SEEN) & ~steep & ~nearer & finer)
    named = [a for a in sorted(share, key=lambda a: -share[a]) if share[a] >= LEAST_SHARE]
    return tuple(named) or ("AO",)
