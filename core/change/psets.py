"""IFC out: the property set ``BimVerify_Change`` on every element."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from ..model.property_sets import ElementProperties, write_property_sets
from ..model.write_psets import TypedValue, scan_source
from ..progress import Progress
from .results import ChangeResult, ElementChange, EpochRecord

PSET_NAME = "BimVerify_Change"


def write_changed_ifc(
    source_ifc: str | Path, result: ChangeResult, out: str | Path, *, progress: Progress | None = None
) -> None:
    """Copy ``source_ifc`` to ``out`` with the changes as property sets; errors as those of ``write_property_sets``."""
    write_property_sets(source_ifc, PSET_NAME, change_entries(result), out, progress=progress)


def change_entries(result: ChangeResult, only: Collection[str] | None = None) -> list[ElementProperties]:
    """The property sets of all elements, or of those with the GlobalIds ``only``."""
    return [
        ElementProperties(element.global_id, element.step_id, change_properties(found, result))
        for element, found in zip(result.model.elements, result.elements, strict=True)
        if only is None or element.global_id in only
    ]


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
