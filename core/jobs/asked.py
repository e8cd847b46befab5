"""A verification of some elements only: where the others must still be looked at, and where that would be lost time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..evidence.sightings import SEARCH_M
from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples

NEIGHBOUR_M = 2 * SEARCH_M
"""Elements farther apart than this cannot account for each other's returns, however far either is looked for."""
ONE_IN = 8
"""Of the positions on all other elements so many are looked at: the errors of stations and surfaces are estimated from the
whole campaign, and need no more."""


def narrowed(model: BuildingModel, samples: SurfaceSamples, only: Collection[str]) -> SurfaceSamples:
    """The samples with ``exposed`` left to those that matter for the elements ``only`` (GlobalIds); all if it is empty.

    Asked elements and what stands next to them keep every position, the others one in ``ONE_IN``. All elements go on
    hiding what is behind them, since that is decided by the model and not by its samples. Raises BimVerifyError when none
    of ``only`` is in the model.
    """
    if not only:
        return samples
    asked = np.array([element.global_id in only for element in model.elements], dtype=np.bool_)
    if not asked.any():
        raise BimVerifyError("None of the elements that were asked for is in the model, or has a body.")
    whole = _near(model, asked)[samples.element]
    thin = np.zeros(len(samples), dtype=np.bool_)
    thin[np.flatnonzero(samples.exposed)[::ONE_IN]] = True
    return replace(samples, exposed=samples.exposed & (whole | thin))


def _near(model: BuildingModel, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(E,) the element's box comes within ``NEIGHBOUR_M`` of that of an asked one."""
    low, high = model.element_bounds
    near = asked.copy()
    for k in np.flatnonzero(asked):
        near |= ((low <= high[k] + NEIGHBOUR_M) & (high >= low[k] - NEIGHBOUR_M)).all(axis=1)
    return near
