"""The state of each element, from what the epochs say of it and from its voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..evidence.overlap import ABSENT_OVERLAP, overlap
from ..model.elements import BuildingModel
from .amounts import Amount
from .look import ElementSight, Seen, glazed
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
    model: BuildingModel, row: int, now: ElementSight, before: ElementSight | None, amount: Amount, tolerance: float
) -> Decision:
    """Decide one element, against the reference epoch, or the model where that saw nothing of it or is none."""
    if before is not None and before.in_doubt:
        return Decision("UNKNOWN", f"In the reference: {before.reason} Now: {now.reason}")
    if before is None or before.seen == "UNSEEN":
        return _against_plan(model, row, now, amount)
    return _against_epoch(model, row, now, before, amount, tolerance)


def undecided(found: Decision) -> Decision:
    """A change that may be an error of the place from which a whole epoch was seen."""
    return Decision("UNKNOWN", f"{found.reason} But everything that was seen may be off by as much: see the warnings.")


def partly_gone(model: BuildingModel, row: int, deep_share: float) -> bool:
    """Whether rays crossed more of an element that stands than models usually leave out.

    ``deep_share``: of its volume, absent in parts at least three voxels thick.
    """
    return deep_share >= LEAST_DEEP_SHARE and not glazed(model, row)


def _against_plan(model: BuildingModel, row: int, now: ElementSight, amount: Amount) -> Decision:
    if now.seen == "MOVED":
        return _moved(model, row, np.array(now.shift), now.reason, now.placed)
    if now.seen == "STANDS" and partly_gone(model, row, amount.deep):
        return Decision("PARTIAL", f"{now.reason} Rays crossed {amount.deep:.0%} of its volume: that part is gone.")
    states: dict[Seen, State] = {
        "STANDS": "CONFIRMED", "GONE": "DISAPPEARED", "PART": "PARTIAL", "UNSEEN": "UNKNOWN",
    }
    return Decision(states[now.seen], now.reason)


def _against_epoch(
    model: BuildingModel, row: int, now: ElementSight, before: ElementSight, amount: Amount, tolerance: float
) -> Decision:
    then = f"In the reference: {before.reason} Now: {now.reason}"
    if now.seen == "UNSEEN":
        return Decision("UNKNOWN", then)
    if before.seen == "GONE":
        return _after_none(model, row, now, amount, then)
    if now.seen == "GONE":
        return Decision("DISAPPEARED", then)
    part_now = _in_part(model, row, now, amount.deep)
    part_then = _in_part(model, row, before, amount.deep_then)
    if part_now or part_then:
        return Decision("PARTIAL", then) if "MOVED" in (now.seen, before.seen) else _parts(amount, part_now, part_then, then)
    change = np.array(now.shift or (0.0, 0.0, 0.0)) - np.array(before.shift or (0.0, 0.0, 0.0))
    left = overlap(model, row, change) <= ABSENT_OVERLAP
    if np.linalg.norm(change) <= tolerance and not (left and now.seen != before.seen):
        return Decision("CONFIRMED", then)
    if left and np.linalg.norm(change) <= now.placed:
        return _moved(model, row, change, then, now.placed)
    if now.seen == "STANDS" and left:  # its place was empty, and no longer is
        return Decision("NEW", f"{then} Its planned place was free in the reference.")
    return _moved(model, row, change, then, now.placed)


def _in_part(model: BuildingModel, row: int, sight: ElementSight, deep_share: float) -> bool:
    return sight.seen == "PART" or (sight.seen == "STANDS" and partly_gone(model, row, deep_share))


def _after_none(model: BuildingModel, row: int, now: ElementSight, amount: Amount, then: str) -> Decision:
    """What stands now of an element that was not there in the reference."""
    if now.seen == "GONE":
        return Decision("UNKNOWN", f"Not there in either epoch. {now.reason}")
    if now.seen == "MOVED":
        share = overlap(model, row, np.array(now.shift))
        off = f"{then} It was not at its planned place then, and stands {1000 * now.distance:.0f} mm off it now"
        if share <= ABSENT_OVERLAP:
            return Decision("UNKNOWN", f"{off}: that place is free in both epochs.", share)
        return Decision("PARTIAL", f"{off}; {share:.0%} of it overlaps that place.", share)
    if _in_part(model, row, now, amount.deep):
        return Decision("PARTIAL", f"{then} A part of it is new, the rest does not stand yet.")
    return Decision("NEW", then)


def _parts(amount: Amount, part_now: bool, part_then: bool, then: str) -> Decision:
    """What became of an element that stood in part, or stands in part now."""
    new = part_then and amount.came >= LEAST_DEEP_SHARE
    gone = amount.left >= LEAST_DEEP_SHARE or (part_now and not part_then and 2.0 * amount.left >= amount.absent)
    if new and gone:
        return Decision("PARTIAL", f"{then} A part that was missing stands now, another one that stood is gone.")
    if new:
        return Decision("PARTIAL", f"{then} A part that was missing stands now.")
    if gone:
        return Decision("PARTIAL", f"{then} A part that stood is gone.")
    return Decision("CONFIRMED", f"{then} What stood of it stands now, and nothing was found of what was missing.")


def _moved(model: BuildingModel, row: int, shift: NDArray[np.float64], reason: str, placed: float) -> Decision:
    share = overlap(model, row, shift)
    if share <= ABSENT_OVERLAP:
        if np.linalg.norm(shift) <= placed:
            slender = f"{share:.0%} of it overlaps, but the accuracy of model and registration may put it as far off."
            return Decision("UNKNOWN", f"{reason} {slender}", share)
        return Decision("DISAPPEARED", f"{reason} It has left its place: {share:.0%} of it overlaps.", share)
    return Decision("PARTIAL", f"{reason} {share:.0%} of it overlaps its place.", share)


def ratios(
    found: Decision, amount: Amount | None, now: ElementSight, before: ElementSight | None = None
) -> tuple[float, float, float, float]:
    """(confirmed, disappeared, new, unknown) shares of an element's volume; they add up to 1.

    Confirmed: stood and stands; disappeared: stood and does not stand; new: stands and did not; unknown: the rest, so also what
    is absent in both epochs. Beams do not enter solids: of the part that is not known to be absent, as much counts as standing
    as of the element's open surface was found; of a moved element only what overlaps its place does, and the rest of that is
    gone. ``before`` None or UNSEEN: the model takes its place. ``amount`` None: no voxel is planned.
    """
    whole = Amount(*(2 * (float(found.state == "DISAPPEARED"),))) if amount is None else amount
    absent, left, built, new = whole.absent, whole.left, 0.0, 0.0
    none_then = before is not None and before.seen == "GONE"
    back = before is not None and before.seen == "MOVED" and now.seen != "MOVED"
    if none_then:
        left = 0.0
    if now.seen not in ("GONE", "UNSEEN") and found.state != "UNKNOWN" and now.exposed > 0:
        at = min(now.at / max(now.exposed - now.beyond - now.silent, 1e-12), 1.0)
        freed = 0.0 if back else (1.0 - found.overlap) * at
        absent = max(absent, freed)
        left = left if none_then else max(left, freed)
        built = min((1.0 - absent) * at, 1.0 if back else found.overlap)
        if found.state == "NEW" or none_then:
            new = built
        elif back:
            new = built * (1.0 - found.overlap)
        else:
            new = built * whole.came / max(whole.came + whole.kept, 1e-12)
    return built - new, left, new, max(1.0 - left - built, 0.0)
