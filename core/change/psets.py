"""IFC out: the property set ``BimVerify_Change`` on every element."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..model.write_psets import TypedValue, apply_property_set, scan_source, write_ifc_copy
from ..progress import Progress
from .results import ChangeResult, ElementChange, EpochRecord

PSET_NAME = "BimVerify_Change"


def write_changed_ifc(
    source_ifc: str | Path, result: ChangeResult, out: str | Path, *, progress: Progress | None = None
) -> None:
    """Copy ``source_ifc`` to ``out`` with the changes as property sets; errors as those of ``write_verified_ifc``."""
    write_ifc_copy(
        source_ifc, out, lambda file: apply_changes(file, result, progress=progress) or not result.elements
    )


def apply_changes(ifc_file: Any, result: ChangeResult, *, progress: Progress | None = None) -> int:
    """Put the changes on the elements of an open ``ifcopenshell.file``; returns how many elements were found."""
    rows = (
        (element.step_id, element.global_id, change_properties(found, result))
        for element, found in zip(result.model.elements, result.elements, strict=True)
    )
    return apply_property_set(ifc_file, PSET_NAME, rows, len(result.elements), progress)


def change_properties(found: ElementChange, result: ChangeResult) -> dict[str, TypedValue]:
    """The property set of one element: name -> (IFC type, value). Metres and cubic metres; None where nothing is known."""
    ratio, volume = "IfcNormalisedRatioMeasure", "IfcVolumeMeasure"
    return {
        "State": ("IfcLabel", found.state),
        "ConfirmedRatio": (ratio, found.confirmed_ratio),
        "DisappearedRatio": (ratio, found.disappeared_ratio),
        "NewRatio": (ratio, found.new_ratio),
        "UnknownRatio": (ratio, found.unknown_ratio),
        "DisappearedVolume": (volume, found.disappeared_volume if found.volume else None),
        "BuiltVolume": (volume, found.built_volume if found.volume else None),
        "ExpectedState": ("IfcLabel", found.expected),
        "Agrees": ("IfcBoolean", found.agrees),
        "Progress": ("IfcLabel", found.progress),
        "VoxelSize": ("IfcLengthMeasure", result.edge),
        "Epoch": ("IfcLabel", epoch_label(result.epoch)),
        "ReferenceEpoch": ("IfcLabel", epoch_label(result.reference) if result.reference else "model"),
        "Method": ("IfcLabel", result.method),
    }


def epoch_label(epoch: EpochRecord) -> str:
    """Date and files of an epoch, as far as a label holds them."""
    return f"{epoch.date} {scan_source(epoch.paths)}".strip()[:255]
