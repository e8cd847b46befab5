"""A model of some of its elements."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .elements import BuildingModel


def part_of(model: BuildingModel, global_ids: Collection[str]) -> tuple[BuildingModel, NDArray[np.int64], NDArray[np.int64]]:
    """The model of the elements with these GlobalIds, (K,) their rows in ``model.elements``, (T,) rows of their triangles.

    Frame and vertices stay. A class of which elements were left out counts as ``partly`` there.
    """
    keep = np.array([element.global_id in global_ids for element in model.elements], dtype=np.bool_)
    rows = np.flatnonzero(keep)
    triangles = np.flatnonzero(keep[model.triangle_element])
    new_row = np.cumsum(keep, dtype=np.int32) - np.int32(1)
    left_out = {element.ifc_class for element, kept in zip(model.elements, keep, strict=True) if not kept}
    elements = tuple(model.elements[row] for row in rows)
    part = replace(
        model, elements=elements, triangles=model.triangles[triangles], closed=model.closed[rows],
        triangle_element=new_row[model.triangle_element[triangles]], transparent=model.transparent[triangles],
        partly=tuple(sorted(({*model.partly} | left_out) & {element.ifc_class for element in elements})),
    )
    return part, rows, triangles
