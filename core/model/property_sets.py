"""Property sets on the elements of an IFC file: typed, in the file's units, each element with a set of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BimVerifyError
from ..files import whole_file
from ..progress import Progress
from .load import open_ifc
from .write_psets import LONGEST_LABEL, TypedValue, element_by_id, own_set, require_owner
from .write_psets import _same_file as same_file
from .write_psets import _scan_source as file_names
from .write_psets import _write_whole as write_whole


@dataclass(frozen=True)
class ElementProperties:
    """The property set of one element: name -> (IFC type, value), None where nothing is known.

    Lengths are in metres and angles in radians until they are written.
    """

    global_id: str
    step_id: int
    values: dict[str, TypedValue]


def write_property_sets(
    source_ifc: str | Path, pset_name: str, entries: Sequence[ElementProperties], out: str | Path, *,
    progress: Progress | None = None,
) -> None:
    """Copy ``source_ifc`` to ``out`` with the entries as property sets ``pset_name``; the source is only read.

    Raises BimVerifyError when ``out`` is the source itself, when the source cannot be read, when it holds none of the
    elements, or when ``out`` cannot be written; nothing is left behind then.
    """
    source, target = Path(source_ifc), Path(out)
    if same_file(source, target):
        raise BimVerifyError(f"{target} is the input model, which is never written to. Give another output name.")
    with whole_file(target) as temporary:
        file = open_ifc(source)
        if not put_property_sets(file, pset_name, entries, progress=progress) and entries:
            raise BimVerifyError(f"{source} holds none of the elements of this result. Give the model that was used.")
        if not write_whole(file, temporary):
            raise BimVerifyError(f"Cannot write {target}: the disk is full. Free some space or choose another place.")


def put_property_sets(
    ifc_file: Any, pset_name: str, entries: Sequence[ElementProperties], *, progress: Progress | None = None
) -> int:
    """Put the entries on the elements of an open ``ifcopenshell.file`` and return how many elements were found.

    Elements that the file does not hold are left out. Each element gets a set of its own: a set that it shares with
    others stays with the others, duplicates are removed, and an unknown number is no property.
    """
    import ifcopenshell.api.pset
    import ifcopenshell.util.unit

    progress = progress or Progress()
    units = {
        "IfcLengthMeasure": float(ifcopenshell.util.unit.calculate_unit_scale(ifc_file)),
        "IfcPlaneAngleMeasure": _angle_unit(ifc_file),
    }
    require_owner(ifc_file)
    found = 0
    for row, entry in enumerate(entries):
        progress.update(row / len(entries), "Writing property sets")
        product = element_by_id(ifc_file, entry.global_id, entry.step_id)
        if product is None:
            continue
        found += 1
        properties = {name: _entity(ifc_file, kind, value, units) for name, (kind, value) in entry.values.items()}
        pset = own_set(ifc_file, product, pset_name)
        if pset is None:
            pset = ifcopenshell.api.pset.add_pset(ifc_file, product=product, name=pset_name)
        properties |= {p.Name: None for p in pset.HasProperties or () if p.Name not in properties}
        ifcopenshell.api.pset.edit_pset(ifc_file, pset=pset, properties=properties, should_purge=True)
    return found


def _angle_unit(file: Any) -> float:
    """Radians per plane angle unit of the file."""
    import ifcopenshell.util.unit

    unit: Any = ifcopenshell.util.unit.get_project_unit(file, "PLANEANGLEUNIT")
    if unit is None or not unit.is_a("IfcConversionBasedUnit"):
        return 1.0
    return float(unit.ConversionFactor.ValueComponent.wrappedValue)


def _entity(file: Any, kind: str, value: str | float | int | bool | None, units: dict[str, float]) -> Any:
    """A typed IFC value in the file's unit; None for an unknown or non-finite one."""
    if value is None or (not isinstance(value, str) and not math.isfinite(value)):
        return None
    if kind == "IfcLabel":
        return file.create_entity(kind, str(value)[:LONGEST_LABEL])
    if kind == "IfcBoolean":
        return file.create_entity(kind, bool(value))
    if kind == "IfcInteger":
        return file.create_entity(kind, int(value))
    number = float(value)
    if kind in units:
        return file.create_entity(kind, number / units[kind])
    return file.create_entity(kind, min(max(number, 0.0), 1.0) if kind == "IfcNormalisedRatioMeasure" else number)


__all__ = [
    "ElementProperties", "file_names", "put_property_sets", "require_owner", "same_file", "write_property_sets", "write_whole",
]
