"""Elements modelled twice: of two with one body no scan tells which was removed, or moved, so they are decided together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..evidence.overlap import ABSENT_OVERLAP, overlap
from ..evidence.shared_surface import SharedSurface
from ..model.elements import BuildingModel

if TYPE_CHECKING:
    from .look import ElementSight

WHOLE_SHARE = 0.95
"""Two elements of which each shares this much of its open surface with the other one have one body."""


def bodies(shared: SharedSurface, exposed: NDArray[np.float64]) -> NDArray[np.int64]:
    """(E,) number of each element's body, the same for twins; ``exposed`` (E,) m2 of them are open."""
    count = len(exposed)
    area = coo_array((shared.area, (shared.element, shared.partner)), shape=(count, count)).tocsr()
    most = area.multiply(1.0 / np.maximum(exposed, 1e-12)[:, None]).tocsr() >= WHOLE_SHARE
    _, body = connected_components(most.multiply(most.T), directed=False)
    return body.astype(np.int64)


def twins_of(body: NDArray[np.int64]) -> list[list[int]]:
    """Rows of the elements of each ``body`` (E,) that is modelled more than once."""
    rows = np.argsort(body, kind="stable")
    groups = np.split(rows, np.flatnonzero(np.diff(body[rows])) + 1)
    return [group.tolist() for group in groups if len(group) > 1]


def decided_together(
    model: BuildingModel, twins: Sequence[Sequence[int]], elements: Sequence[ElementSight]
) -> tuple[ElementSight, ...]:
    """The same, but nothing is said of twins unless the body that they have is gone, or off its place, as a whole.

    Each of the ``elements`` (E,) was looked at as if its twins were no others.
    """
    sights = list(elements)
    for group in twins:
        if all(_left(model, row, sights[row]) for row in group) or all(sights[row].seen == "MOVED" for row in group):
            continue
        for row in group:
            if sights[row].seen != "UNSEEN":
                other = next(twin for twin in group if twin != row)
                sights[row] = replace(
                    sights[row], seen="UNSEEN", shift=None, reason=may_be_either(model, other), in_doubt=True
                )
    return tuple(sights)


def may_be_either(model: BuildingModel, other: int) -> str:
    """Why nothing is said of an element whose surface element ``other`` has too."""
    element = model.elements[other]
    name = f"{element.ifc_class} {element.name}".strip()
    return f"What was found of its surface is also that of {name} ({element.global_id}): it may be either."


def _left(model: BuildingModel, row: int, sight: ElementSight) -> bool:
    """Whether nothing of an element stands at its place."""
    if sight.seen == "MOVED" and sight.shift is not None:
        return overlap(model, row, np.array(sight.shift)) <= ABSENT_OVERLAP
    return sight.seen == "GONE"
