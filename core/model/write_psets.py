"""IFC out: the property set ``BimVerify_Verification`` on every verified element, in the file's schema and units."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

from ..errors import BimVerifyError
from ..files import same_file, whole_file
from ..progress import Progress
from ..results import LEVELS, ElementVerdict, VerificationResult
from .load import open_ifc

PSET_NAME = "BimVerify_Verification"
LONGEST_LABEL = 255
"""IfcLabel holds at most this many characters."""
END_OF_FILE = b"END-ISO-10303-21;"

TypedValue = tuple[str, str | float | int | bool | None]
"""IFC type and value; a length is in metres until it is written."""


def write_verified_ifc(
    source_ifc: str | Path, result: VerificationResult, out: str | Path, *, progress: Progress | None = None
) -> None:
    """Copy ``source_ifc`` to ``out`` with the verdicts of ``result`` as property sets; the source is only read.

    An element that carries the set already (from an earlier run) gets its values replaced; a decision on an element of which
    ``result`` holds none stays. Raises BimVerifyError when
    ``out`` is the source itself, when the source cannot be read, when it holds none of the verified elements, or when
    ``out`` cannot be written; nothing is left behind then.
    """
    write_ifc_copy(source_ifc, out, lambda file: write_verdicts(file, result, progress=progress))


def write_verdicts(
    ifc_file: Any, result: VerificationResult, *, taken_back: Collection[str] = (), progress: Progress | None = None
) -> bool:
    """Put the verdicts and decisions of ``result`` into an open file; False when it holds none of the elements.

    ``taken_back``: GlobalIds of elements whose decision in the file does not hold any more.
    """
    from .decisions import apply_decisions, remove_decision

    found = apply_psets(ifc_file, result, progress=progress) or not result.verdicts
    for global_id in taken_back:
        remove_decision(ifc_file, global_id)
    apply_decisions(ifc_file, result.decisions)
    return bool(found)


def write_ifc_copy(source_ifc: str | Path, out: str | Path, add: Callable[[Any], int | bool]) -> None:
    """Copy ``source_ifc`` to ``out`` with what ``add`` puts into the open file; it returns 0 when no element was found.

    Raises BimVerifyError as ``write_verified_ifc`` does.
    """
    source, target = Path(source_ifc), Path(out)
    if same_file(source, target):
        raise BimVerifyError(f"{target} is the input model, which is never written to. Give another output name.")
    with whole_file(target) as temporary:
        file = open_ifc(source)
        if not add(file):
            raise BimVerifyError(f"{source} holds none of the verified elements. Give the model that was verified.")
        write_open_file(file, temporary, target)


def write_open_file(file: Any, temporary: Path, target: str | Path) -> None:
    """Write an open IFC file to a temporary place; raises BimVerifyError, naming ``target``, when it does not fit."""
    if not _write_whole(file, temporary):
        raise BimVerifyError(f"Cannot write {target}: the disk is full. Free some space or choose another place.")


def apply_psets(ifc_file: Any, result: VerificationResult, *, progress: Progress | None = None) -> int:
    """Put the verdicts on the elements of an open ``ifcopenshell.file`` and return how many elements were found.

    Elements that the file no longer holds are left out. Each element gets a set of its own: a set that it shares with
    others stays with the others, duplicates are removed, and an unknown number is no property.
    """
    source = scan_source(result.scan_paths)
    rows = (
        (element.step_id, element.global_id,
         verification_properties(verdict, source, result.scan_date, result.method))
        for element, verdict in zip(result.model.elements, result.verdicts, strict=True)
    )
    return apply_property_set(ifc_file, PSET_NAME, rows, len(result.verdicts), progress)


def apply_property_set(
    ifc_file: Any, name: str, rows: Iterable[tuple[int, str, dict[str, TypedValue]]], count: int,
    progress: Progress | None = None,
) -> int:
    """Put a property set on elements (STEP id, GlobalId, properties) of an open file; returns how many were found.

    Elements that the file no longer holds are left out. Each element gets a set of its own: a set that it shares with
    others stays with the others, duplicates are removed, and an unknown number is no property.
    """
    import ifcopenshell.api.pset
    import ifcopenshell.util.unit

    progress = progress or Progress()
    units = {
        "IfcLengthMeasure": float(ifcopenshell.util.unit.calculate_unit_scale(ifc_file)),
        "IfcVolumeMeasure": float(ifcopenshell.util.unit.calculate_unit_scale(ifc_file, "VOLUMEUNIT")),
        "IfcPlaneAngleMeasure": float(ifcopenshell.util.unit.calculate_unit_scale(ifc_file, "PLANEANGLEUNIT")),
    }
    require_owner(ifc_file)
    found = 0
    for row, (step_id, global_id, typed) in enumerate(rows):
        progress.update(row / max(count, 1), "Writing property sets")
        product = element_by_id(ifc_file, global_id, step_id)
        if product is None:
            continue
        found += 1
        properties = {
            key: _entity(ifc_file, kind, value, units.get(kind, 1.0)) for key, (kind, value) in typed.items()
        }
        pset = own_set(ifc_file, product, name)
        if pset is None:
            pset = ifcopenshell.api.pset.add_pset(ifc_file, product=product, name=name)
        properties |= {p.Name: None for p in pset.HasProperties or () if p.Name not in properties}
        ifcopenshell.api.pset.edit_pset(ifc_file, pset=pset, properties=properties, should_purge=True)
    return found


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


def _entity(file: Any, kind: str, value: str | float | int | bool | None, unit: float) -> Any:
    """A typed IFC value in the file's unit, which is ``unit`` of SI; None for an unknown or non-finite one."""
    if value is None or (not isinstance(value, str) and not math.isfinite(value)):
        return None
    if kind == "IfcLabel":
        return file.create_entity(kind, str(value)[:LONGEST_LABEL])
    if kind == "IfcBoolean":
        return file.create_entity(kind, bool(value))
    if kind == "IfcInteger":
        return file.create_entity(kind, int(value))
    number = float(value)
    if kind == "IfcNormalisedRatioMeasure":
        return file.create_entity(kind, min(max(number, 0.0), 1.0))
    return file.create_entity(kind, number / unit)


def scan_source(paths: tuple[str, ...]) -> str:
    """File names (no folders) as far as a label holds them."""
    names = list(dict.fromkeys(Path(path).name for path in paths))
    for kept in range(len(names), 0, -1):
        more = f" and {len(names) - kept} more" if kept < len(names) else ""
        label = ", ".join(names[:kept]) + more
        if len(label) <= LONGEST_LABEL:
            return label
    return names[0][:LONGEST_LABEL] if names else ""


def element_by_id(file: Any, global_id: str, step_id: int = 0) -> Any | None:
    """The element, by STEP id first (if given), because some files use a GlobalId twice; None if it is not there."""
    for key in (step_id, global_id) if step_id else (global_id,):
        try:
            found = file[key]
        except RuntimeError:
            continue
        if getattr(found, "GlobalId", None) == global_id:
            return found
    return None


def plain_values(pset: Any) -> dict[str, Any]:
    """Name -> value of the single values in a property set, in the file's units."""
    return {
        p.Name: p.NominalValue.wrappedValue
        for p in pset.HasProperties or ()
        if p.is_a("IfcPropertySingleValue") and p.NominalValue is not None
    }


def own_set(file: Any, product: Any, name: str = PSET_NAME) -> Any | None:
    """The element's own set of that name, safe to edit without touching anything else; extra and shared ones detached."""
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


def _write_whole(file: Any, path: Path) -> bool:
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
