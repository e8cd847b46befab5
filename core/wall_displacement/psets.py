"""IFC out: the property set ``BimVerify_Displacement`` on the element that is the wall."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..model.property_sets import ElementProperties, put_property_sets, write_property_sets
from ..model.write_psets import TypedValue, scan_source
from .result import DisplacementResult
from .tables import column_moved, largest

PSET_NAME = "BimVerify_Displacement"
NEAR_ELEMENT_M = 1.0
"""A wall found farther than this from the element's box is another one."""


def element_box(model: BuildingModel, global_id: str) -> np.ndarray:
    """(2, 3) lowest and highest corner of an element [m, model frame]; BimVerifyError when the model has no such element."""
    for row, element in enumerate(model.elements):
        if element.global_id == global_id:
            corners = model.vertices[model.triangles[model.triangle_start[row]:model.triangle_start[row + 1]].ravel()]
            return np.stack([corners.min(axis=0), corners.max(axis=0)]) + model.origin
    raise BimVerifyError(
        f"{model.path} has no element with a body and the GlobalId {global_id!r}. Give --element the GlobalId of the wall."
    )


def check_is_element(result: DisplacementResult, box: np.ndarray, global_id: str) -> None:
    """Raise BimVerifyError when most of the wall that was found does not stand where the element does."""
    places = result.field.points if len(result.field.points) else np.array([j.position for j in result.joints]).reshape(-1, 3)
    off = np.linalg.norm(np.maximum(np.maximum(box[0] - places, places - box[1]), 0.0), axis=1)
    if not len(off) or np.median(off) > NEAR_ELEMENT_M:
        raise BimVerifyError(
            f"The wall found in the scans is not where the element {global_id} stands. The scans must be in the model's frame; "
            "give --near a point on the wall."
        )


def displacement_properties(result: DisplacementResult) -> dict[str, TypedValue]:
    """The property set of the wall: name -> (IFC type, value). Lengths in metres; None where nothing is known."""
    length, ratio, count = "IfcLengthMeasure", "IfcNormalisedRatioMeasure", "IfcInteger"
    paired = tuple(j for j in result.joints if j.state == "PAIRED")
    vertical, lateral = largest(paired, "vertical"), largest(paired, "lateral")
    bows = [c.bow for c in result.columns if c.bow is not None]
    field = result.field
    return {
        "ColumnCount": (count, len(result.columns)),
        "JointCount": (count, len(paired)),
        "NewJointCount": (count, sum(j.state == "NEW" for j in result.joints)),
        "MissingJointCount": (count, sum(j.state == "MISSING" for j in result.joints)),
        "VerticalMean": (length, _mean([j.vertical for j in paired])),
        "VerticalLargest": (length, None if vertical is None else vertical.vertical),
        "VerticalSigma": (length, None if vertical is None else vertical.vertical_sigma),
        "LateralMean": (length, _mean([j.lateral for j in paired])),
        "LateralLargest": (length, None if lateral is None else lateral.lateral),
        "LateralSigma": (length, None if lateral is None else lateral.lateral_sigma),
        "BowLargest": (length, max(bows, key=abs, default=None)),
        "DetectionLevel": (length, float(np.median(field.detection)) if len(field.detection) else None),
        "SignificantRatio": (ratio, float(field.significant.mean()) if len(field.detection) else None),
        "MovedColumnCount": (count, sum(column_moved(c) for c in result.columns)),
        "Significant": ("IfcBoolean", any(column_moved(c) for c in result.columns)),
        "RegistrationSigma": (length, result.registration_sigma),
        "BaseSource": ("IfcLabel", scan_source(result.base_paths) or None),
        "LaterSource": ("IfcLabel", scan_source(result.later_paths) or None),
        "BaseDate": ("IfcLabel", result.base_date or None),
        "LaterDate": ("IfcLabel", result.later_date or None),
    }


def write_displacement_ifc(source_ifc: str | Path, global_id: str, result: DisplacementResult, out: str | Path) -> None:
    """Copy ``source_ifc`` to ``out`` with the displacement of the wall ``global_id``; the source is only read.

    Raises BimVerifyError as ``property_sets.write_property_sets`` does.
    """
    write_property_sets(source_ifc, PSET_NAME, _entries(global_id, result), out)


def apply_displacement_pset(ifc_file: Any, global_id: str, result: DisplacementResult) -> int:
    """Put the displacement on the wall in an open ``ifcopenshell.file``; returns how many elements were found."""
    return put_property_sets(ifc_file, PSET_NAME, _entries(global_id, result))


def _entries(global_id: str, result: DisplacementResult) -> list[ElementProperties]:
    return [ElementProperties(global_id, 0, displacement_properties(result))]


def _mean(values: list[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return float(np.mean(known)) if known else None
