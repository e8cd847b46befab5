"""IFC out: the property set ``BimVerify_ScanQuality`` on every element, in the file's schema and units."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from ..model.property_sets import ElementProperties, write_property_sets
from ..model.write_psets import TypedValue, scan_source
from ..progress import Progress
from ..sensing.loa import label
from .results import ElementQuality, QualityResult

PSET_NAME = "BimVerify_ScanQuality"


def write_quality_ifc(
    source_ifc: str | Path, result: QualityResult, out: str | Path, *, progress: Progress | None = None
) -> None:
    """Copy ``source_ifc`` to ``out`` with the scan quality of every element; the source is only read.

    Raises BimVerifyError as ``property_sets.write_property_sets`` does.
    """
    write_property_sets(source_ifc, PSET_NAME, quality_entries(result), out, progress=progress)


def quality_properties(quality: ElementQuality, result: QualityResult) -> dict[str, TypedValue]:
    """The property set of one element: name -> (IFC type, value); None where nothing is known."""
    ratio, length, angle = "IfcNormalisedRatioMeasure", "IfcLengthMeasure", "IfcPlaneAngleMeasure"
    m = quality.measured
    exposed = m.area > 0
    return {
        "PointSpacing": (length, m.spacing),
        "PointSpacingP95": (length, m.spacing_p95),
        "Noise": (length, m.noise),
        "EdgeNoise": (length, quality.edge_noise),
        "EdgeNoiseShape": ("IfcReal", quality.edge_shape),
        "Coverage": (ratio, m.coverage if exposed else None),
        "OccludedRatio": (ratio, m.missing["occluded"] if exposed else None),
        "OutOfRangeRatio": (ratio, m.missing["out of range"] if exposed else None),
        "GrazingRatio": (ratio, m.missing["too grazing"] if exposed else None),
        "AbsorbedRatio": (ratio, m.missing["absorbed"] if exposed else None),
        "OutsideViewRatio": (ratio, m.missing["outside the field of view"] if exposed else None),
        "SeenThroughRatio": (ratio, m.missing["seen through"] if exposed else None),
        "LargestOccluder": ("IfcLabel", quality.hidden[0].name if quality.hidden else None),
        "IncidenceP95": (angle, m.incidence_p95),
        "RangeMedian": (length, m.range_median),
        "RegistrationResidual": (length, m.registration),
        "BuiltOffset": (length, quality.built_offset),
        "PredictedError": (length, quality.predicted_error),
        "GsaLevel": ("IfcInteger", quality.gsa_level),
        "SupportedLOA": ("IfcLabel", label(quality.supported_loa)),
        "CorrectiveAction": ("IfcLabel", ", ".join(quality.actions) or "NONE"),
        "ScanSource": ("IfcLabel", scan_source(result.scan_paths) or None),
        "ScanDate": ("IfcLabel", result.scan_date or None),
        "Method": ("IfcLabel", result.method or None),
    }


def quality_entries(result: QualityResult, only: Collection[str] | None = None) -> list[ElementProperties]:
    """The property sets of all elements, or of those with the GlobalIds ``only``."""
    return [
        ElementProperties(quality.global_id, element.step_id, quality_properties(quality, result))
        for element, quality in zip(result.model.elements, result.elements, strict=True)
        if only is None or quality.global_id in only
    ]
