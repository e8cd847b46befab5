"""The state of each element, from what the epochs say of it and from its voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evidence.decide import GLAZED
from ..model.elements import BuildingModel
from .look import ElementSight, Seen
from .overlap import ABSENT_OVERLAP, overlap
from .results import State

LEAST_DEEP_SHARE = 0.1
"""A standing element of which rays crossed this share, in parts three voxels thick, is partly gone: below it, pipes through a
wall, recesses and reveals that models leave out would count as demolition."""


@dataclass(frozen=True)
class Decision:
    """State of an element and why; ``overlap`` is the share of it that is where it was, 1 unless it moved."""

    state: State
    reason: str
    overlap: float = 1.0


def element_state(
    model: BuildingModel, row: int, now: ElementSight, before: ElementSight | None, deep_share: float, tolerance: float
) -> Decision:
    """Decide one element, against the reference epoch, or the model where that saw nothing or is none.

    ``deep_share``: share of its volume that disappeared in parts at least three voxels thick.
    """
    if before is None or before.seen == "UNSEEN":
        found = _against_plan(model, row, now)
    else:
        found = _against_epoch(model, row, now, before, tolerance)
    if found.state == "CONFIRMED" and partly_gone(model, row, deep_share):
        return Decision("PARTIAL", f"{found.reason} Rays crossed {deep_share:.0%} of its volume: that part is gone.")
    return found


def partly_gone(model: BuildingModel, row: int, deep_share: float) -> bool:
    """Whether rays crossed more of an element that stands than models usually leave out."""
    return deep_share >= LEAST_DEEP_SHARE and not _glazed(model, row)


def _against_plan(model: BuildingModel, row: int, now: ElementSight) -> Decision:
    if now.seen == "MOVED":
        return _moved(model, row, np.array(now.shift), now.reason)
    states: dict[Seen, State] = {
        "STANDS": "CONFIRMED", "GONE": "DISAPPEARED", "PART": "PARTIAL", "UNSEEN": "UNKNOWN",
    }
    return Decision(states[now.seen], now.reason)


def _against_epoch(
    model: BuildingModel, row: int, now: ElementSight, before: ElementSight, tolerance: float
) -> Decision:
    then = f"In the reference: {before.reason} Now: {now.reason}"
    if now.seen == "UNSEEN":
        return Decision("UNKNOWN", then)
    if before.seen == "GONE":
        if now.seen == "GONE":
            return Decision("UNKNOWN", f"Not there in either epoch. {now.reason}")
        return Decision("PARTIAL" if now.seen == "PART" else "NEW", then)
    if now.seen == "GONE":
        return Decision("DISAPPEARED", then)
    if "PART" in (now.seen, before.seen):
        return Decision("PARTIAL", then)
    change = np.array(now.shift or (0.0, 0.0, 0.0)) - np.array(before.shift or (0.0, 0.0, 0.0))
    left = overlap(model, row, change) <= ABSENT_OVERLAP
    if np.linalg.norm(change) <= tolerance and not (left and now.seen != before.seen):
        return Decision("CONFIRMED", then)
    if now.seen == "STANDS" and left:  # its place was empty, and no longer is
        return Decision("NEW", f"{then} Its planned place was free in the reference.")
    return _moved(model, row, change, then)


def _moved(model: BuildingModel, row: int, shift: NDArray[np.float64], reason: str) -> Decision:
    share = overlap(model, row, shift)
    if share <= ABSENT_OVERLAP:
        return Decision("DISAPPEARED", f"{reason} It has left its place: {share:.0%} of it overlaps.", share)
    return Decision("PARTIAL", f"{reason} {share:.0%} of it overlaps its place.", share)


def _glazed(model: BuildingModel, row: int) -> bool:
    start = model.triangle_start
    return model.elements[row].ifc_class.startswith(GLAZED) or bool(
        model.transparent[start[row] : start[row + 1]].any()
    )


def ratios(
    found: Decision, counts: NDArray[np.int64], now: ElementSight
) -> tuple[float, float, float, float]:
    """(confirmed, disappeared, new, unknown) shares of an element's volume; they add up to 1.

    ``counts`` (4,) voxels unknown, confirmed, new, disappeared. Beams do not enter solids: of the part that no ray crossed,
    as much counts as standing as of the element's open surface was found; of a moved element only what overlaps its place does,
    and the rest of that is gone.
    """
    total = int(counts.sum())
    gone = counts[3] / total if total else float(found.state == "DISAPPEARED")
    stands = now.seen not in ("GONE", "UNSEEN") and found.state != "UNKNOWN"
    built = 0.0
    if stands and now.exposed > 0:
        at = min(now.at / max(now.exposed - now.beyond - now.silent, 1e-12), 1.0)
        gone = max(gone, (1.0 - found.overlap) * at)
        built = min((1.0 - gone) * at, found.overlap)
    new = built if found.state == "NEW" else 0.0
    return float(built - new), float(gone), float(new), float(max(1.0 - gone - built, 0.0))
