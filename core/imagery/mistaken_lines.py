"""Lines that are taken for the wrong edge and pass every test, because they lie within the tolerance of the search."""

from __future__ import annotations

import math

SEARCH_WIDTH = 0.002
"""Tolerance of a hypothesis built on few matches, share of the image's width."""
MISTAKEN = 0.1
"""Share of the matches that are wrong and pass their tests: lines of something else within the tolerance, as found in photos of
two buildings whose truth is known."""


def mistaken_px(width: int) -> float:
    """Root mean square of what such matches put a line off as a whole [px], over all lines of an image ``width`` [px] wide."""
    return math.sqrt(MISTAKEN / 3.0) * SEARCH_WIDTH * width
