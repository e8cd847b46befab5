"""IFC out: the property set ``BimVerify_Verification`` on every verified element, in the file's schema and units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..progress import Progress
from ..results import LEVELS, ElementVerdict, VerificationResult
from .property_sets import (
    LONGEST_LABEL,
    ElementProperties,
    TypedValue,
    file_names,
    put_property_sets,
    write_property_sets,
)

PSET_NAME = "BimVerify_Verification"


def write_verified_ifc(
    source_ifc: str | Path, result: VerificationResult, out: str | Path, *, progress: Progress | None = None
) -> None:
    """Copy ``source_ifc`` to ``out`` with the verdicts of ``result`` as property sets; the source is only read.

    An element that carries the set already (from an earlier run) gets its values replaced. Raises BimVerifyError when
    ``out`` is the source itself, when the source cannot be read, when it holds none of the verified elements, or when
    ``out`` cannot be written; nothing is left behind then.
    """
    write_property_sets(source_ifc, PSET_NAME, _entries(result), out, progress=progress)


def apply_psets(ifc_file: Any, result: VerificationResult, *, progress: Progress | None = None) -> int:
    """Put the verdicts on the elements of an open ``ifcopenshell.file`` and return how many elements were found."""
    return put_property_sets(ifc_file, PSET_NAME, _entries(result), progress=progress)


def _entries(result: VerificationResult) -> list[ElementProperties]:
    source = file_names(result.scan_paths)
    return [
        ElementProperties(
            verdict.global_id, element.step_id,
            verification_properties(verdict, source, result.scan_date, result.method),
        )
        for element, verdict in zip(result.model.elements, result.verdicts, strict=True)
    ]


def verification_properties(
    verdict: ElementVerdict, scan_source: str, scan_date: str, method: str
) -> dict[str, TypedValue]:
    """The property set of one element: name -> (IFC type, value). Lengths in metres; None where nothing is known."""
    ratio, length = "IfcNormalisedRatioMeasure", "IfcLengthMeasure"
    shift = verdict.displacement_vector or (None, None, None)
    return {
        "Status": ("IfcLabel", verdict.status),
        "RequiredLOA": ("IfcLabel", verdict.required_loa),
        "AchievedLOA": ("IfcLabel", verdict.achieved_loa),
        "BeliefOccupied": (ratio, verdict.belief_occupied),
        "BeliefEmpty": (ratio, verdict.belief_empty),
        "BeliefUnknown": (ratio, verdict.belief_unknown),
        "Conflict": (ratio, verdict.conflict),
        "Coverage": (ratio, verdict.coverage),
        **{f"ConfirmedRatioLOA{level}": (ratio, verdict.confirmed_ratio.get(level)) for level in LEVELS},
        "SampleCount": ("IfcInteger", verdict.sample_count),
        "DeviationMedian": (length, verdict.deviation_median),
        "DeviationP95": (length, verdict.deviation_p95),
        "Displacement": (length, verdict.displacement),
        "DisplacementX": (length, shift[0]),
        "DisplacementY": (length, shift[1]),
        "DisplacementZ": (length, shift[2]),
        "DisplacementSigma": (length, verdict.displacement_sigma),
        "Significant": ("IfcBoolean", verdict.significant),
        "MeasurementSigma": (length, verdict.measurement_sigma),
        "RegistrationSigma": (length, verdict.registration_sigma),
        "ScanSource": ("IfcLabel", scan_source or None),
        "ScanDate": ("IfcLabel", scan_date or None),
        "Method": ("IfcLabel", method or None),
    }


__all__ = ["LONGEST_LABEL", "PSET_NAME", "apply_psets", "verification_properties", "write_verified_ifc"]
