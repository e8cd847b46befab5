"""A tiny IFC made in code, and a plausible verification of it, for the tests of everything that is written out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.options import VerifyOptions
from bim_verify.core.results import (
    LEVELS,
    AlignmentRecord,
    ElementVerdict,
    SampleEvidence,
    StationRecord,
    Status,
    VerificationResult,
)
from bim_verify.core.sensing.loa import UPPER_BOUND_M

UNITS = {"mm": 0.001, "m": 1.0, "foot": 0.3048}
WALLS = (("South", 0.0, 0.0, 4.0, 0.2), ("North", 0.0, 2.8, 4.0, 0.2), ("West", 0.0, 0.2, 0.2, 2.6))
"""Name, x, y, length in x, length in y, metres."""
ROOTED = ("IfcRel", "IfcWall", "IfcSlab", "IfcColumn", "IfcProject", "IfcBuilding")


def make_ifc(
    path: Path, *, schema: str = "IFC4", unit: str = "mm", names: tuple[str, ...] = (), owner: bool = True
) -> Path:
    """Three walls, a slab and a column, in the given schema and length unit; ``names`` replaces element names in order.

    ``owner`` False leaves an IFC2X3 file without the person and application that its schema expects.
    """
    import ifcopenshell
    import ifcopenshell.guid

    file = ifcopenshell.file(schema=schema)
    scale = UNITS[unit]

    def new(kind: str, **attributes: Any) -> Any:
        if schema == "IFC2X3" and kind.startswith(ROOTED):
            attributes["OwnerHistory"] = history
        return file.create_entity(kind, **attributes)

    def at(x: float, y: float, z: float) -> Any:
        point = file.create_entity("IfcCartesianPoint", [float(x) / scale, float(y) / scale, float(z) / scale])
        return file.create_entity("IfcLocalPlacement", None, file.create_entity("IfcAxis2Placement3D", point))

    history = None
    if schema == "IFC2X3" and owner:
        person = file.create_entity("IfcPerson", FamilyName="Tester")
        organisation = file.create_entity("IfcOrganization", Name="Tests")
        user = file.create_entity("IfcPersonAndOrganization", person, organisation)
        application = file.create_entity("IfcApplication", organisation, "1", "Tests", "tests")
        history = file.create_entity("IfcOwnerHistory", user, application, None, "ADDED", CreationDate=0)
    zero = file.create_entity("IfcCartesianPoint", [0.0, 0.0, 0.0])
    axes = file.create_entity("IfcAxis2Placement3D", zero)
    context = file.create_entity("IfcGeometricRepresentationContext", None, "Model", 3, 1e-5, axes)
    project = new("IfcProject", GlobalId=ifcopenshell.guid.new(), Name="Small house")
    project.RepresentationContexts = [context]
    project.UnitsInContext = file.create_entity("IfcUnitAssignment", [_length_unit(file, unit)])
    storey = new("IfcBuildingStorey", GlobalId=ifcopenshell.guid.new(), Name="Ground floor", CompositionType="ELEMENT")
    storey.ObjectPlacement = at(0, 0, 0)
    building = new("IfcBuilding", GlobalId=ifcopenshell.guid.new(), Name="House", CompositionType="ELEMENT")
    new("IfcRelAggregates", GlobalId=ifcopenshell.guid.new(), RelatingObject=project, RelatedObjects=[building])
    new("IfcRelAggregates", GlobalId=ifcopenshell.guid.new(), RelatingObject=building, RelatedObjects=[storey])

    boxes = [("IfcWall", name, x, y, 0.0, dx, dy, 2.5) for name, x, y, dx, dy in WALLS]
    boxes += [("IfcSlab", "Floor", 0.0, 0.0, -0.2, 4.0, 3.0, 0.2), ("IfcColumn", "Post", 3.4, 1.4, 0.0, 0.2, 0.2, 2.5)]
    products = []
    for row, (kind, name, x, y, z, dx, dy, dz) in enumerate(boxes):
        centre = file.create_entity("IfcCartesianPoint", [dx / 2 / scale, dy / 2 / scale])
        place = file.create_entity("IfcAxis2Placement2D", centre)
        profile = file.create_entity("IfcRectangleProfileDef", "AREA", None, place, dx / scale, dy / scale)
        up = file.create_entity("IfcDirection", [0.0, 0.0, 1.0])
        solid = file.create_entity("IfcExtrudedAreaSolid", profile, axes, up, dz / scale)
        body = file.create_entity("IfcShapeRepresentation", context, "Body", "SweptSolid", [solid])
        shape = file.create_entity("IfcProductDefinitionShape", None, None, [body])
        label = names[row] if row < len(names) else name
        product = new(kind, GlobalId=ifcopenshell.guid.new(), Name=label, Representation=shape)
        product.ObjectPlacement = at(x, y, z)
        products.append(product)
    new(
        "IfcRelContainedInSpatialStructure",
        GlobalId=ifcopenshell.guid.new(), RelatedElements=products, RelatingStructure=storey,
    )
    file.write(str(path))
    return path


def _length_unit(file: Any, unit: str) -> Any:
    if unit != "foot":
        return file.create_entity("IfcSIUnit", None, "LENGTHUNIT", "MILLI" if unit == "mm" else None, "METRE")
    metre = file.create_entity("IfcSIUnit", None, "LENGTHUNIT", None, "METRE")
    factor = file.create_entity("IfcMeasureWithUnit", file.create_entity("IfcRatioMeasure", 0.3048), metre)
    size = file.create_entity("IfcDimensionalExponents", 1, 0, 0, 0, 0, 0, 0)
    return file.create_entity("IfcConversionBasedUnit", size, "LENGTHUNIT", "FOOT", factor)


def fabricate(model: BuildingModel, *, seed: int = 0, spacing: float = 0.1, **changes: Any) -> VerificationResult:
    """Made-up verdicts that go round all five statuses, and evidence to match; ``changes`` replaces fields."""
    rng = np.random.default_rng(seed)
    samples = sample_surface(model, spacing)
    options = VerifyOptions()
    verdicts: list[ElementVerdict] = []
    columns = {name: np.zeros(len(samples), np.float32) for name in ("m_occ", "m_emp", "m_unk", "conflict")}
    deviation = np.full(len(samples), np.nan, np.float32)
    for row, element in enumerate(model.elements):
        mine = np.flatnonzero(samples.element == row)
        status: Status = ("CONFIRMED", "DEVIATING", "ABSENT", "PARTIAL", "NOTOBSERVED")[row % 5]
        seen = mine[rng.random(len(mine)) < {"PARTIAL": 0.35, "NOTOBSERVED": 0.0}.get(status, 0.9)]
        for name in columns:
            columns[name][mine] = 1.0 if name == "m_unk" else 0.0
        columns["m_unk"][seen] = 0.05
        columns["m_emp" if status == "ABSENT" else "m_occ"][seen] = 0.95
        shift = 0.012 if status == "DEVIATING" else 0.0
        if status not in ("ABSENT", "NOTOBSERVED"):
            deviation[seen] = shift * np.sign(samples.normal[seen, 0] + 1e-9) + rng.normal(0, 0.0015, len(seen))
        mean = {name: float(column[mine].mean()) for name, column in columns.items()}
        measured = np.abs(deviation[mine][np.isfinite(deviation[mine])])
        moved = len(measured) > 0
        ratio = {lv: float(np.mean(measured < UPPER_BOUND_M[lv])) if moved else 0.0 for lv in LEVELS}
        verdicts.append(
            ElementVerdict(
                global_id=element.global_id, ifc_class=element.ifc_class, name=element.name, storey=element.storey,
                status=status, required_loa="LOA30", achieved_loa="LOA40" if status == "CONFIRMED" else "NONE",
                belief_occupied=mean["m_occ"], belief_empty=mean["m_emp"], belief_unknown=mean["m_unk"],
                conflict=0.01, coverage=1.0 - mean["m_unk"], confirmed_ratio=ratio,
                sample_count=len(mine), observed_count=len(seen), area=float(samples.area[mine].sum()),
                deviation_median=float(np.nanmedian(deviation[mine])) if moved else None,
                deviation_p95=float(np.quantile(measured, 0.95)) if moved else None,
                displacement=shift if moved else None,
                displacement_vector=(shift, 0.0, 0.0) if moved else None,
                displacement_sigma=0.0009 if moved else None,
                significant=shift > 0 if moved else None,
                measurement_sigma=0.0025, registration_sigma=0.0008,
                reason=f"{len(seen)} of {len(mine)} positions were seen.", stations=("S1",) if len(seen) else (),
            )
        )
    sigma = np.where(np.isfinite(deviation), 0.002, np.nan).astype(np.float32)
    record: dict[str, Any] = {
        "model": model, "options": options, "verdicts": tuple(verdicts), "samples": samples,
        "evidence": SampleEvidence(**columns, deviation=deviation, sigma=sigma),
        "stations": (
            StationRecord("S1", (2.0, 1.5, 1.4), 120_000, 6e-4, 0.0008, True, "2024-05-01T09:30:00"),
            StationRecord("S2", (-3.0, 1.5, 1.4), 80_000, 6e-4, float("nan"), False),
        ),
        "alignment": AlignmentRecord(
            "fine", np.eye(4), np.diag([1e-8] * 3 + [1e-7, 1e-7, 4e-7]), np.zeros(3), "up (z), 0.6 mm", 0.0021, 0.91
        ),
        "scan_paths": ("scans/house.e57",), "scan_date": "2024-05-01", "method": "bim_verify 0.1.0 station",
        "dropped": {"invalid": 12, "zero": 3}, "timings": {"read scans": 1.25, "evidence": 2.5},
        "warnings": ("Made up.",),
    }  # fmt: skip
    return VerificationResult(**{**record, **changes})


def small_result(folder: Path, **ifc: Any) -> VerificationResult:
    """The made-up verification of a freshly written ``make_ifc`` file in ``folder``."""
    return fabricate(load_model(make_ifc(folder / "house.ifc", **ifc), cache=False, threads=1))
