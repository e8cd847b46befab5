"""Which elements of a campaign are partly demolished: an end or a stretch of a wall or slab is cut away."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from .clip import body_volume, cut_away, keep_below
from .scene import Edit, face_axes

Array = NDArray[np.float64]

CUT_CLASSES = ("IfcWall", "IfcSlab")
SHORTEST_M = 1.0
LENGTH_SHARE = (0.3, 0.6)
"""Of the length that is cut away."""
VOLUME_SHARE = (0.28, 0.7)
"""Elements that lose less or more of their volume are left whole: openings make it differ from the length."""
END_SHARE = 0.65
"""Of the cuts take an end away, the others a stretch in between."""
LEAST_EXPOSED_M2 = 1.0


def choose_cuts(
    model: BuildingModel, samples: SurfaceSamples, edits: Mapping[int, Edit], *, seed: int, share: float
) -> dict[int, Edit]:
    """Cuts across the length of walls and slabs that a scanner could see: of ``share`` of them, at least of one.

    Elements that are edited already, or are not closed bodies, are left alone.
    """
    random = np.random.default_rng((seed, 8))
    exposed = np.bincount(samples.element, weights=samples.area * samples.exposed, minlength=len(model.elements))
    candidates = [
        row for row, element in enumerate(model.elements)
        if element.ifc_class.startswith(CUT_CLASSES) and model.closed[row] and row not in edits
        and exposed[row] > LEAST_EXPOSED_M2
    ]
    wanted = max(round(share * len(candidates)), 1)
    found: dict[int, Edit] = {}
    for row in random.permutation(np.array(candidates, dtype=np.int64)).tolist():
        if len(found) == wanted:
            break
        edit = _cut(element_corners(model, row), random)
        if edit is not None:
            found[row] = edit
    return found


def element_corners(model: BuildingModel, row: int) -> Array:
    """(T, 3, 3) triangles of one element as planned, metres, local frame."""
    start = model.triangle_start
    return model.vertices[model.triangles[start[row] : start[row + 1]]]


def removed_share(corners: Array, edit: Edit) -> float:
    """Share of the volume of a closed body (T, 3, 3) that a cut takes away."""
    return 1.0 - body_volume(cut_away(corners, np.array(edit.direction), *edit.removed)) / body_volume(corners)


def _cut(corners: Array, random: np.random.Generator) -> Edit | None:
    """A cut across the longest of the body's main directions; None where it takes too little or too much, or the body is
    not one that can be cut."""
    axes = face_axes(corners)
    along = corners.reshape(-1, 3) @ axes.T
    extent = np.ptp(along, axis=0)
    longest = int(np.argmax(np.round(extent, 6)))
    length, low = float(extent[longest]), float(along[:, longest].min())
    share, place, end = random.uniform(*LENGTH_SHARE), random.random(), random.random() < END_SHARE
    if length < SHORTEST_M:
        return None
    if end:
        removed = (-math.inf, low + share * length) if place < 0.5 else (low + (1.0 - share) * length, math.inf)
    else:
        begin = low + length * (0.1 + place * (0.8 - share))
        removed = (begin, begin + share * length)
    x, y, z = (float(v) for v in axes[longest])
    edit = Edit("cut", direction=(x, y, z), removed=removed)
    whole = body_volume(corners)
    for height in filter(math.isfinite, removed):
        halves = body_volume(keep_below(corners, axes[longest], height)) + body_volume(
            keep_below(corners, -axes[longest], -height)
        )
        if abs(halves - whole) > 1e-6 * whole:
            return None
    return edit if VOLUME_SHARE[0] <= removed_share(corners, edit) <= VOLUME_SHARE[1] else None
