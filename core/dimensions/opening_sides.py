"""Why a clear width or height of an opening was not measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROLES = ("width", "height")
NO_SCANS = "its edges on the wall's face were not looked for, because the scans are no longer there"
ENOUGH = 0.5
"""Share of a side that is free, or was measured, beyond which another reason is likelier."""


def at_the_face(what: str) -> str:
    """The name of a width or height between edges on the wall's faces."""
    return f"{what} at the face"


def in_the_frame(what: str) -> str:
    """The name of one between the inner faces of what stands in the opening."""
    return f"{what} in the frame"


def why_not(what: str, normal: Array, exposed: Flags, measured: Flags, fillings: Sequence[str]) -> str:
    """From the (N, 3) normals of the places on an opening's sides, whether they are free and whether they were measured."""
    upright = np.abs(normal[:, 2]) < 0.5
    if what == "height":
        sides = [("above", normal[:, 2] < -0.5), ("below", normal[:, 2] > 0.5)]
    else:
        first = normal[upright][0] if upright.any() else np.array([1.0, 0.0, 0.0])
        along = np.where(upright, normal @ first, 0.0)
        sides = [("at one side", along > 0.5), ("at the other side", along < -0.5)]
    told = []
    for name, own in sides:
        if not own.any():
            told.append(f"nothing bounds it {name}")
        elif exposed[own].mean() < ENOUGH:
            told.append(f"{name} it is covered by {', '.join(fillings) or 'another element'}")
        elif not measured[own & exposed].any():
            told.append(f"it was not seen {name}")
        else:
            told.append(f"too little was seen of it {name}" if measured[own].mean() < ENOUGH else "")
    return "; ".join(t for t in told if t) or "its sides were seen, but not opposite each other"
