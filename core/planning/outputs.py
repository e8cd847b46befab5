"""The plan as files: JSON that the simulator reads, a table, and annotations in a copy of the model."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..files import whole_file
from ..model.write_psets import require_owner, write_ifc_copy
from ..report.csv_out import csv_bytes, guard
from ..report.json_out import to_plain, write_document
from .results import PlanResult

FORMAT, FORMAT_VERSION = "bim_verify.plan", 1
OBJECT_TYPE = "ScannerStation"


def plan_to_json(result: PlanResult) -> dict[str, Any]:
    """A stations file (see ``simulation.stations_file``) with everything else beside. Metres, radians, model frame."""
    model = result.model
    plain: dict[str, Any] = to_plain({
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "method": result.method,
        "summary": result.summary(),
        "scanner": asdict(result.scanner),
        "stations": [asdict(s) for s in result.stations],
        "existing_stations": result.existing,
        "elements": [asdict(f) for f in result.forecasts],
        "model": {"path": model.path, "sha256": model.content_hash, "schema": model.schema, "project": model.project_name},
        "options": result.options,
        "places": result.places,
        "heuristic_stations": result.heuristic,
        "timings": result.timings,
        "warnings": result.warnings,
    })
    return plain


def write_plan_json(path: str | Path, result: PlanResult) -> None:
    """Write ``plan_to_json``; BimVerifyError when ``path`` cannot be written."""
    write_document(path, plan_to_json(result))


def write_plan_csv(path: str | Path, result: PlanResult) -> None:
    """One line per station, in the order to scan in; metres, model frame."""
    header = (
        "Name", "X_m", "Y_m", "Z_m", "Floor_m", "Minutes", "Area_m2", "NewArea_m2", "Actions", "LinkedTo", "Elements",
        "Completes",
    )
    rows = (
        [
            guard(s.name), *(f"{x:.3f}" for x in s.position), "" if s.floor is None else f"{s.floor:.3f}",
            f"{s.minutes:.1f}", f"{s.area:.2f}", f"{s.new_area:.2f}", " ".join(s.actions), guard("; ".join(s.linked_to)),
            " ".join(s.for_elements), " ".join(f.global_id for f in result.completed(number)),
        ]
        for number, s in enumerate(result.stations, 1)
    )
    with whole_file(path) as temporary:
        temporary.write_bytes(csv_bytes(header, rows))


def write_plan_ifc(source_ifc: str | Path, result: PlanResult, out: str | Path) -> None:
    """Copy the model to ``out`` with one IfcAnnotation a station, placed at the scanner's centre; the source is only read.

    Raises BimVerifyError when ``out`` is the source, or a file cannot be read or written.
    """
    def add(file: Any) -> bool:
        add_annotations(file, result)
        return True

    write_ifc_copy(source_ifc, out, add)


def add_annotations(file: Any, result: PlanResult) -> None:
    """Put the stations into an open ``ifcopenshell.file`` as annotations, in its own length unit."""
    import ifcopenshell.api.pset
    import ifcopenshell.api.root
    import ifcopenshell.util.unit

    unit = float(ifcopenshell.util.unit.calculate_unit_scale(file))
    require_owner(file)
    sites = file.by_type("IfcBuilding") or file.by_type("IfcSite") or file.by_type("IfcProject")
    made = []
    for station in result.stations:
        annotation = ifcopenshell.api.root.create_entity(file, ifc_class="IfcAnnotation", name=station.name)
        annotation.ObjectType = OBJECT_TYPE
        place = [float(x) / unit for x in station.position]
        axis = file.create_entity("IfcAxis2Placement3D", file.create_entity("IfcCartesianPoint", place))
        annotation.ObjectPlacement = file.create_entity("IfcLocalPlacement", RelativePlacement=axis)
        pset = ifcopenshell.api.pset.add_pset(file, product=annotation, name="BimVerify_Station")
        ifcopenshell.api.pset.edit_pset(file, pset=pset, properties={
            "Scanner": file.create_entity("IfcLabel", result.scanner.name),
            "Minutes": file.create_entity("IfcReal", float(station.minutes)),
            "CorrectiveAction": file.create_entity("IfcLabel", ", ".join(station.actions) or "NONE"),
            "LinkedTo": file.create_entity("IfcLabel", ", ".join(station.linked_to)[:255] or "NONE"),
        })
        made.append(annotation)
    if made and not sites[0].is_a("IfcProject"):
        owner = next((r.OwnerHistory for r in file.by_type("IfcRelContainedInSpatialStructure")), None)
        import ifcopenshell.guid

        file.create_entity(
            "IfcRelContainedInSpatialStructure", GlobalId=ifcopenshell.guid.new(), OwnerHistory=owner,
            RelatedElements=made, RelatingStructure=sites[0],
        )
