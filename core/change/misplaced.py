"""What is said of an epoch that seems not to lie where it should, or not to belong to the model at all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..options import ChangeOptions
from .look import EpochSight
from .results import CommonShift

SMALLEST_M = 0.002
"""A common shift below this is no news, whatever was stated: buildings are set out no better."""
LEAST_FOUND, LEAST_WHEN_APART = 0.6, 0.75
"""An epoch that finds less than this share of the elements in view may be of another building; more where those that it finds
share no place."""


def found_ratio(sight: EpochSight) -> float | None:
    """Share of the elements in view that were found, at their planned places, elsewhere or in part; None where none was in
    view. Counted by element: of a wrong building it is the large floors and ceilings that seem to fit."""
    found = sum(e.seen in ("STANDS", "MOVED", "PART") for e in sight.elements)
    lost = sum(e.seen == "GONE" or e.in_doubt for e in sight.elements)
    return found / (found + lost) if found + lost else None


def misplaced(name: str, against: str, offset: CommonShift | None, edge: float, options: ChangeOptions) -> Iterator[str]:
    """A warning where an epoch lies farther from the model (or another epoch) than voxels of ``edge`` [m], or the registration
    sigma that was stated, leave open."""
    stated = options.registration_sigma
    limit = 0.5 * edge if stated is None else 2.0 * stated
    if offset is None or offset.reach <= max(limit, SMALLEST_M):
        return
    counted = (
        f"{1000 * offset.axis_sigma:.0f} mm are counted as registration sigma for that" if stated is None
        else f"only the {1000 * stated:g} mm that you stated are counted as registration sigma"
    )
    move = ", or move them onto the model (--align fine)" if options.align == "none" else ""
    yield (
        f"The {name} lies {offset.in_words()} from the {against}, as {offset.elements} elements agree: {counted}. Register its "
        f"scans anew{move}; where the building itself stands so, state --registration-sigma-mm."
    )


def place_open(names: Sequence[str]) -> Iterator[str]:
    """A warning on epochs whose place is known too badly to call anything changed."""
    if names:
        yield (
            f"The place of the scans or photos is known too badly for that ({', '.join(names)}): no element is called new, "
            "moved or gone, and no voxel or group new or gone."
        )


def strange(name: str, sight: EpochSight) -> Iterator[str]:
    """A warning where little of what is in view was found."""
    found = found_ratio(sight)
    if found is not None and found < (LEAST_WHEN_APART if sight.offset is None else LEAST_FOUND):
        yield (
            f"Only {found:.0%} of the elements that the {name} has in view were found: unless so many are not built, or gone, "
            "it is of another building, or far from its place. Compare model and scans, or move the scans onto the model "
            "(--align auto)."
        )
