"""Property sets on the elements of an IFC file: typed, in the file's units, each element with a set of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BimVerifyError
from ..files import whole_file
from ..progress import Progress
from .load import open_ifc

LONGEST_LABEL = 255
"""IfcLabel holds at most this many characters."""
END_OF_FILE = b"END-ISO-10303-21;"

TypedValue = tuple[str, str | float | int | bool | None]
"""IFC type and value; lengths in metres and angles in radians until they are written."""


@dataclass(frozen=True)
class ElementProperties:
    """The property set of one element: name -> (IFC type, value), None where nothing is known."""

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
        product = _find(ifc_file, entry.global_id, entry.step_id)
        if product is None:
            continue
        found += 1
        properties = {name: _entity(ifc_file, kind, value, units) for name, (kind, value) in entry.values.items()}
        pset = _own_set(ifc_file, product, pset_name)
        if pset is None:
            pset = ifcopenshell.api.pset.add_pset(ifc_file, product=product, name=pset_name)
        properties |= {p.Name: None for p in pset.HasProperties or () if p.Name not in properties}
        ifcopenshell.api.pset.edit_pset(ifc_file, pset=pset, properties=properties, should_purge=True)
    return found


def file_names(paths: tuple[str, ...]) -> str:
    """File names (no folders) as far as a label holds them."""
    names = list(dict.fromkeys(Path(path).name for path in paths))
    for kept in range(len(names), 0, -1):
        more = f" and {len(names) - kept} more" if kept < len(names) else ""
        label = ", ".join(names[:kept]) + more
        if len(label) <= LONGEST_LABEL:
            return label
    return names[0][:LONGEST_LABEL] if names else ""


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


def _find(file: Any, global_id: str, step_id: int) -> Any | None:
    """The element, by STEP id first, because some files use a GlobalId twice."""
    for key in (step_id, global_id):
        try:
            found = file[key]
        except RuntimeError:
            continue
        if getattr(found, "GlobalId", None) == global_id:
            return found
    return None


def _own_set(file: Any, product: Any, name: str) -> Any | None:
    """The element's own set of this name, safe to edit without touching anything else; extra and shared ones detached."""
    import ifcopenshell.api.pset

    own = None
    for relation, pset in list(_sets(product, name)):
        if len(relation.RelatedObjects) > 1:
            relation.RelatedObjects = [o for o in relation.RelatedObjects if o != product]
        elif file.get_total_inverses(pset) > 1:
            _remove_relation(file, relation)
        elif own is None:
            own = pset
        else:
            ifcopenshell.api.pset.remove_pset(file, product=product, pset=pset)
    if own is not None:
        _keep_plain_properties(file, own)
    return own


def _sets(product: Any, name: str) -> Iterator[tuple[Any, Any]]:
    for relation in product.IsDefinedBy or ():
        if not relation.is_a("IfcRelDefinesByProperties"):
            continue
        pset = relation.RelatingPropertyDefinition
        if pset.is_entity() and pset.is_a("IfcPropertySet") and pset.Name == name:
            yield relation, pset


def _remove_relation(file: Any, relation: Any) -> None:
    import ifcopenshell.util.element

    history = relation.OwnerHistory
    file.remove(relation)
    if history is not None:
        ifcopenshell.util.element.remove_deep2(file, history)


def _keep_plain_properties(file: Any, pset: Any) -> None:
    """Drop from the set what must not be edited in place: properties of other sets, with a unit, or repeated."""
    import ifcopenshell.util.element

    keep: dict[str, Any] = {}
    drop = []
    for prop in pset.HasProperties or ():
        shared = file.get_total_inverses(prop) > 1
        if shared or prop.Name in keep or not prop.is_a("IfcPropertySingleValue") or prop.Unit:
            drop.append((prop, shared))
        else:
            keep[prop.Name] = prop
    if drop:
        pset.HasProperties = list(keep.values())
        for prop, shared in drop:
            if not shared:
                ifcopenshell.util.element.remove_deep2(file, prop)


def require_owner(file: Any) -> None:
    """IFC2X3 demands an owner on every set: add a person and an application where the file has none."""
    if file.schema != "IFC2X3":
        return
    import ifcopenshell.api.owner

    if not file.by_type("IfcPersonAndOrganization"):
        owner = ifcopenshell.api.owner
        person = owner.add_person(file, identification="bim_verify", family_name="bim_verify", given_name="")
        organisation = owner.add_organisation(file, identification="bim_verify", name="bim_verify")
        owner.add_person_and_organisation(file, person=person, organisation=organisation)
    if not file.by_type("IfcApplication"):
        ifcopenshell.api.owner.add_application(
            file, application_full_name="bim_verify", application_identifier="bim_verify"
        )


def same_file(first: Path, second: Path) -> bool:
    try:
        return first.samefile(second)
    except OSError:
        return first.resolve() == second.resolve()


def write_whole(file: Any, path: Path) -> bool:
    """Write the IFC; False when it did not fit.

    Versions of the library raise RuntimeError then and leave a file of their own beside ``path``, or say nothing.
    """
    try:
        file.write(str(path), format=".ifc")
        with path.open("rb") as stream:
            stream.seek(max(path.stat().st_size - 64, 0))
            return END_OF_FILE in stream.read()
    except (RuntimeError, OSError):
        for left in path.parent.iterdir():
            if left.name.startswith(path.name + "."):
                left.unlink(missing_ok=True)
        return False
