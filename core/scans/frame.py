"""Scans in the frame of the map are brought into the model's own."""

from __future__ import annotations

import numpy as np

from ..alignment.transform import TransformedSource, from_parts
from ..errors import BimVerifyError
from ..model.elements import BuildingModel, MapConversion
from ..options import ScanFrame
from .campaign import ScanSource

NEAR_M = 500.0
"""A station farther than this from the model's box is not one that scanned it."""


def to_model_frame(model: BuildingModel, source: ScanSource, frame: ScanFrame) -> ScanSource:
    """The source with stations and returns in the model's frame.

    ``auto`` takes the scans as they are unless no station is near the model while, seen through the model's map
    conversion, one is: a scan is never moved by an offset that was not its own. Scans keep their true size, so a map
    conversion that scales is applied about the model's middle. Raises BimVerifyError when ``map`` is asked for and the
    model has no map conversion.
    """
    conversion = model.map_conversion
    if frame == "model" or (frame == "auto" and conversion is None):
        return source
    if conversion is None:
        raise BimVerifyError(f"{model.path} has no map conversion, so a scan in the map's frame cannot be placed in it.")
    positions = np.array([s.position for s in source.stations])
    if frame == "auto" and (
        _distance(model, positions) <= NEAR_M or _distance(model, conversion.to_model(positions)) > NEAR_M
    ):
        return source
    middle = model.bounds.mean(axis=0) + model.origin
    turn = MapConversion(np.zeros(3), conversion.angle, 1.0).to_model(np.eye(3)).T
    there = conversion.to_map(middle[None, :])[0]
    return TransformedSource(source, from_parts(turn, middle - turn @ there))


def _distance(model: BuildingModel, positions: np.ndarray) -> float:
    low, high = model.bounds + model.origin
    return float(np.linalg.norm(np.maximum(np.maximum(low - positions, positions - high), 0.0), axis=1).min())
