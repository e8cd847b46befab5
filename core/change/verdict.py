"""From what speaks for and against an element at its planned place to what it says of it.

What other elements share speaks for neither, and few beams, or a small part of the surface, are no evidence.
"""

from __future__ import annotations

from typing import Literal

from ..evidence.own_evidence import LEAST_OPPOSED, OwnEvidence, shows_gone, shows_standing
from ..evidence.thresholds import Thresholds

Verdict = Literal["STANDS", "GONE", "PART", "LITTLE", "BESIDE", "EITHER", "FEW"]
"""It stands, it is gone, part of it stands; rays pass, but too little of it was in view, or it may stand beside; what was found
of it may be another element's; too few beams tell of it."""

PART_GONE = 0.25
"""A part of what stands is gone when beams show that more than this share passes: slender elements that stand let up to a
fifth pass along their edges."""


def verdict(
    own: OwnEvidence, row: int, seen_share: float, shares: tuple[float, float], t: Thresholds, glazed: bool = False,
    clear: OwnEvidence | None = None,
) -> Verdict:
    """What the evidence says of element ``row``, of whose open surface ``seen_share`` was in view.

    shares : (absent up to this share of what was seen of it at its place, present from this share on); ``glazed``: rays may
    pass it though all of it stands; ``clear``: the same evidence without beams that pass where it may stand beside.
    """
    absent, present = shares
    clear = clear or own
    at, through, mine = int(own.beams_at[row]), int(own.beams_through[row]), own.share(row)
    passed = int(clear.beams_through[row])
    found = float(own.at[row] + own.either[row])
    told = found + float(own.beyond[row])
    maybe = at + int(own.beams_split[row])  # a part of whose light met something else: not from it, or from it all the same
    if mine <= absent and shows_gone(maybe, through, present) and own.beyond[row] >= LEAST_OPPOSED * told:
        if not shows_gone(maybe + through - passed, passed, present):
            return "BESIDE"
        return "LITTLE" if seen_share < t.absent_seen_share else "GONE"
    if own.own_by_chance(row):
        return "EITHER"
    if absent < mine < present and shows_standing(at, 0, absent) and shows_gone(0, through, present):
        if seen_share < t.absent_seen_share:
            return "LITTLE"
        beams = at + through + int(own.beams_either[row])
        there = round(beams * found / told)  # whosever the shared surface is
        if not shows_gone(there, beams - there, present):
            return "EITHER"
        return "PART" if clear.share(row) < present and shows_gone(0, passed, present) else "BESIDE"
    if mine >= present and shows_standing(at, through, absent):
        missing = clear.beyond[row] >= PART_GONE * told and shows_standing(passed, at, PART_GONE)
        return "PART" if missing and not glazed and seen_share >= t.absent_seen_share else "STANDS"
    return "EITHER" if own.either[row] > own.at[row] else "FEW"
