"""The state of each element, from what the epochs say of it and from its voxels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..evidence.decide import GLAZED
from ..evidence.thresholds import Thresholds
from ..model.elements import BuildingModel
from .look import ElementSight
from .results import State

LEAST_DEEP_SHARE = 0.1
"""A standing element of which rays crossed this share, in parts three voxels thick, is partly gone: below it, pipes through a
wall, recesses and reveals that models leave out would count as demolition."""
ABSENT_OVERLAP = Thresholds.absent_share
"""An element moved so far that no more than this of it overlaps its planned place has left that place."""


def element_state(
    model: BuildingModel, row: int, now: ElementSight, before: ElementSight | None, deep_share: float, tolerance: float
) -> tuple[State, str]:
    """State and reason of one element, against the reference epoch, or the model where that saw nothing or is none.

    ``deep_share``: share of its volume that disappeared in parts at least three voxels thick.
    """
    if before is None or before.seen == "UNSEEN":
        state, reason = _against_plan(model, row, now)
    else:
        state, reason = _against_epoch(model, row, now, before, tolerance)
    if state == "CONFIRMED" and deep_share >= LEAST_DEEP_SHARE and not _glazed(model, row):
        return "PARTIAL", f"{reason} Rays crossed {deep_share:.0%} of its volume: that part is gone."
    return state, reason


def _against_plan(model: BuildingModel, row: int, now: ElementSight) -> tuple[State, str]:
    if now.seen == "STANDS":
        return "CONFIRMED", now.reason
    if now.seen == "GONE":
        return "DISAPPEARED", now.reason
    if now.seen == "PART":
        return "PARTIAL", now.reason
    if now.seen == "UNSEEN":
        return "UNKNOWN", now.reason
    return _moved(model, row, np.array(now.shift), now.reason)


def _against_epoch(
    model: BuildingModel, row: int, now: ElementSight, before: ElementSight, tolerance: float
) -> tuple[State, str]:
    then = f"In the reference: {before.reason} Now: {now.reason}"
    if now.seen == "UNSEEN":
        return "UNKNOWN", then
    if before.seen == "GONE":
        if now.seen == "GONE":
            return "UNKNOWN", f"Not there in either epoch. {now.reason}"
        return ("PARTIAL" if now.seen == "PART" else "NEW"), then
    if now.seen == "GONE":
        return "DISAPPEARED", then
    if "PART" in (now.seen, before.seen):
        return "PARTIAL", then
    change = np.array(now.shift or (0.0, 0.0, 0.0)) - np.array(before.shift or (0.0, 0.0, 0.0))
    if np.linalg.norm(change) <= tolerance:
        return "CONFIRMED", then
    return _moved(model, row, change, then)


def _moved(model: BuildingModel, row: int, shift: NDArray[np.float64], reason: str) -> tuple[State, str]:
    share = overlap(model, row, shift)
    if share <= ABSENT_OVERLAP:
        return "DISAPPEARED", f"{reason} It has left its place: {share:.0%} of it overlaps."
    return "PARTIAL", f"{reason} {share:.0%} of it overlaps its place."


def overlap(model: BuildingModel, row: int, shift: NDArray[np.float64]) -> float:
    """Share of an element's extent along a shift [m] that overlaps itself after the shift: exact for prisms along it."""
    length = float(np.linalg.norm(shift))
    if length < 1e-9:
        return 1.0
    start = model.triangle_start
    corner = model.vertices[model.triangles[start[row] : start[row + 1]]].reshape(-1, 3)
    extent = float(np.ptp(corner @ (shift / length)))
    return max(1.0 - length / max(extent, 1e-9), 0.0)


def _glazed(model: BuildingModel, row: int) -> bool:
    start = model.triangle_start
    return model.elements[row].ifc_class.startswith(GLAZED) or bool(
        model.transparent[start[row] : start[row + 1]].any()
    )


def ratios(
    state: State, counts: NDArray[np.int64], now: ElementSight, present: bool
) -> tuple[float, float, float, float]:
    """(confirmed, disappeared, new, unknown) shares of an element's volume; they add up to 1.

    ``counts`` (4,) voxels unknown, confirmed, new, disappeared. Beams do not enter solids: of the part that no ray crossed,
    as much counts as built as of the element's open surface was found at its place.
    """
    total = int(counts.sum())
    gone = counts[3] / total if total else (1.0 if state == "DISAPPEARED" else 0.0)
    surface = max(now.exposed - now.beyond, 1e-12)
    built = (1.0 - gone) * min(now.at / surface, 1.0) if present and now.exposed > 0 else 0.0
    new = built if state == "NEW" else 0.0
    confirmed = 0.0 if state == "NEW" else built
    return float(confirmed), float(gone), float(new), float(max(1.0 - gone - built, 0.0))
