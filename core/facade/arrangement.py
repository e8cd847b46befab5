"""How elements stand beside and above one another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .records import Arrangement, FacadeBox

CONNECTED_M = 0.6
"""Elements are connected along an axis when what is between them is narrower than this."""


def arrangement(boxes: Sequence[FacadeBox], axis: str) -> Arrangement:
    """Connected: most elements are closer to the next one along the axis than a pier of a wall is wide."""
    other = "z" if axis == "x" else "x"
    gaps = []
    for a in boxes:
        ahead = [
            getattr(b, f"{axis}0") - getattr(a, f"{axis}1")
            for b in boxes
            if getattr(b, f"{axis}0") >= getattr(a, f"{axis}1") - 0.05
            and min(getattr(a, f"{other}1"), getattr(b, f"{other}1")) > max(getattr(a, f"{other}0"), getattr(b, f"{other}0"))
        ]
        if ahead:
            gaps.append(min(ahead))
    return "connected" if gaps and float(np.median(gaps)) < CONNECTED_M else "separated"
