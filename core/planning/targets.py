"""The surface that a plan has to cover, as points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from .options import PlanOptions
from .strips import face_widths

Array = NDArray[np.float64]
AREA_PER_POINT_M2 = 0.06
FEWEST, MOST = 30, 300
"""Points on an element."""
MOST_POINTS = 60_000
SECOND_THINNER = 0.5
"""The second set of points is twice as dense, and none of its points is in the first unless all are."""


@dataclass(frozen=True)
class Targets:
    """Points (P, 3) on exposed planned surfaces, ordered by element; metres, local frame."""

    row: NDArray[np.int64]
    """Rows of the samples they were taken from."""
    position: Array
    normal: Array
    area: Array
    """m2 of exposed surface that each stands for."""
    element: NDArray[np.int32]
    across: Array
    """(P, 3) unit vectors over the face, from its nearest edge to the opposite one."""
    width: Array
    """(P,) of the face in that direction; infinite without edges."""

    def __len__(self) -> int:
        return len(self.area)


def choose_elements(model: BuildingModel, options: PlanOptions) -> NDArray[np.bool_]:
    """(E,) the elements that the options choose. Raises BimVerifyError when there are none."""
    chosen = np.ones(len(model.elements), dtype=np.bool_)
    if options.classes:
        wanted = {c.casefold() for c in options.classes}
        chosen &= np.array([e.ifc_class.casefold() in wanted for e in model.elements])
    if options.elements:
        chosen &= np.array([e.global_id in options.elements for e in model.elements])
    if not chosen.any():
        there = ", ".join(sorted({e.ifc_class for e in model.elements})[:12])
        raise BimVerifyError(f"{model.path} has none of the elements asked for; it has {there}.")
    return chosen


def second_targets(model: BuildingModel, samples: SurfaceSamples, chosen: NDArray[np.bool_]) -> Targets:
    """Other points than the usual ones, twice as many: plans are held against them."""
    return pick_targets(model, samples, chosen, offset=1, thinner=SECOND_THINNER)


def pick_targets(
    model: BuildingModel, samples: SurfaceSamples, chosen: NDArray[np.bool_], offset: int = 0, thinner: float = 1.0
) -> Targets:
    """An even selection of the exposed samples of the chosen elements; another ``offset`` gives other points.

    ``thinner``: so many times fewer than usual.
    """
    rows = np.flatnonzero(samples.exposed & chosen[samples.element])
    element = samples.element[rows]
    count = len(chosen)
    number = np.bincount(element, minlength=count)
    area = np.bincount(element, weights=samples.area[rows], minlength=count)
    wanted = np.clip(area / AREA_PER_POINT_M2, FEWEST, MOST) / thinner
    if wanted[number > 0].sum() > MOST_POINTS:
        wanted *= MOST_POINTS / wanted[number > 0].sum()
    stride = np.maximum(number / np.maximum(wanted, 1.0), 1.0)
    first = np.concatenate([[0], np.cumsum(number)])[:-1]
    rank = np.arange(len(rows)) - first[element] + 0.5 * offset * stride[element]
    step = np.floor(rank / stride[element])
    taken = np.concatenate([[True], (np.diff(step) > 0) | (np.diff(element) != 0)]) if len(rows) else np.zeros(0, np.bool_)
    rows = rows[taken]
    element = samples.element[rows]
    kept = np.bincount(element, minlength=count)
    position, normal = samples.position[rows], samples.normal[rows]
    across, width = face_widths(model, position, normal, element)
    return Targets(rows, position, normal, area[element] / np.maximum(kept[element], 1), element, across, width)
