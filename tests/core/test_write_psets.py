"""Property sets: names, types and units per schema; a second run replaces; nothing else is touched."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.api.pset
import ifcopenshell.util.element
import ifcopenshell.validate
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.write_psets import PSET_NAME, apply_psets, write_verified_ifc

from .factory import UNITS, make_ifc, small_result

RATIOS = ["BeliefOccupied", "BeliefEmpty", "BeliefUnknown", "Conflict", "Coverage"]
RATIOS += [f"ConfirmedRatioLOA{level}" for level in (10, 20, 30, 40, 50)]
LENGTHS = ["DeviationMedian", "DeviationP95", "Displacement", "DisplacementX", "DisplacementY", "DisplacementZ"]
LENGTHS += ["DisplacementSigma", "MeasurementSigma", "RegistrationSigma"]
LABELS = ["Status", "RequiredLOA", "AchievedLOA", "ScanSource", "ScanDate", "Method"]
CONTRACT = {
    **dict.fromkeys(RATIOS, "IfcNormalisedRatioMeasure"),
    **dict.fromkeys(LENGTHS, "IfcLengthMeasure"),
    **dict.fromkeys(LABELS, "IfcLabel"),
    "SampleCount": "IfcInteger",
    "Significant": "IfcBoolean",
}


def typed_properties(path: Path, global_id: str) -> dict[str, tuple[str, Any]]:
    file = ifcopenshell.open(str(path))
    sets = [
        rel.RelatingPropertyDefinition
        for rel in file.by_guid(global_id).IsDefinedBy
        if rel.is_a("IfcRelDefinesByProperties") and rel.RelatingPropertyDefinition.Name == PSET_NAME
    ]
    assert len(sets) == 1
    return {p.Name: (p.NominalValue.is_a(), p.NominalValue.wrappedValue) for p in sets[0].HasProperties}


def entities(path: Path) -> int:
    return sum(1 for _ in ifcopenshell.open(str(path)))


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4", "IFC4X3"])
@pytest.mark.parametrize("unit", list(UNITS))
def test_names_types_and_units(tmp_path: Path, schema: str, unit: str) -> None:
    result = small_result(tmp_path, schema=schema, unit=unit)
    write_verified_ifc(tmp_path / "house.ifc", result, tmp_path / "out.ifc")
    found = typed_properties(tmp_path / "out.ifc", result.verdicts[1].global_id)
    assert {name: kind for name, (kind, _) in found.items()} == CONTRACT
    in_file = {"mm": 12.0, "m": 0.012, "foot": 0.012 / 0.3048}[unit]
    assert found["Displacement"][1] == pytest.approx(in_file, rel=1e-12)
    assert found["DisplacementX"][1] == pytest.approx(in_file, rel=1e-12)
    assert found["Status"][1] == "DEVIATING"
    assert found["Significant"][1] is True
    assert found["ScanSource"][1] == "house.e57"
    assert sum(found[f"Belief{part}"][1] for part in ("Occupied", "Empty", "Unknown")) == pytest.approx(1.0)


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4", "IFC4X3"])
def test_output_is_valid_and_a_second_run_adds_nothing(tmp_path: Path, schema: str) -> None:
    result = small_result(tmp_path, schema=schema)
    write_verified_ifc(tmp_path / "house.ifc", result, tmp_path / "once.ifc")
    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(ifcopenshell.open(str(tmp_path / "once.ifc")), log)
    assert log.statements == []
    moved = replace(result.verdicts[1], status="ABSENT", deviation_median=None, displacement=None)
    changed = replace(result, verdicts=(result.verdicts[0], moved, *result.verdicts[2:]))
    write_verified_ifc(tmp_path / "once.ifc", changed, tmp_path / "twice.ifc")
    assert entities(tmp_path / "twice.ifc") == entities(tmp_path / "once.ifc") - 2
    found = typed_properties(tmp_path / "twice.ifc", moved.global_id)
    assert found["Status"] == ("IfcLabel", "ABSENT")
    assert "Displacement" not in found and "DeviationMedian" not in found
    write_verified_ifc(tmp_path / "twice.ifc", result, tmp_path / "thrice.ifc")
    assert entities(tmp_path / "thrice.ifc") == entities(tmp_path / "once.ifc")


def test_ifc2x3_without_owner_gets_one(tmp_path: Path) -> None:
    result = small_result(tmp_path, schema="IFC2X3", owner=False)
    write_verified_ifc(tmp_path / "house.ifc", result, tmp_path / "out.ifc")
    file = ifcopenshell.open(str(tmp_path / "out.ifc"))
    assert all(pset.OwnerHistory is not None for pset in file.by_type("IfcPropertySet"))


def test_unknown_numbers_are_left_out(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    nan = replace(result.verdicts[0], registration_sigma=float("nan"), deviation_p95=float("inf"))
    broken = replace(result, verdicts=(nan, *result.verdicts[1:]))
    write_verified_ifc(tmp_path / "house.ifc", broken, tmp_path / "o.ifc")
    found = typed_properties(tmp_path / "o.ifc", nan.global_id)
    assert "RegistrationSigma" not in found and "DeviationP95" not in found
    absent = typed_properties(tmp_path / "o.ifc", result.verdicts[2].global_id)
    assert not {"Displacement", "DeviationMedian", "Significant"} & set(absent)
    assert "nan" not in (tmp_path / "o.ifc").read_text().lower()


def test_shared_and_repeated_sets(tmp_path: Path) -> None:
    """A set shared with a foreign element stays with it; a second set of the name goes; shared properties survive."""
    result = small_result(tmp_path)
    file = ifcopenshell.open(str(tmp_path / "house.ifc"))
    first, second = (file.by_guid(v.global_id) for v in result.verdicts[:2])
    storey = file.by_type("IfcBuildingStorey")[0]
    shared = ifcopenshell.api.pset.add_pset(file, product=storey, name=PSET_NAME)
    ifcopenshell.api.pset.edit_pset(file, pset=shared, properties={"Status": "KEEP"})
    ifcopenshell.api.pset.assign_pset(file, products=[first], pset=shared)
    for _ in range(2):
        new_id = ifcopenshell.guid.new
        extra = file.create_entity("IfcPropertySet", new_id(), None, PSET_NAME, None, shared.HasProperties)
        relation = file.create_entity("IfcRelDefinesByProperties", new_id(), RelatedObjects=[second])
        relation.RelatingPropertyDefinition = extra
    common = ifcopenshell.api.pset.add_pset(file, product=first, name="Pset_WallCommon")
    ifcopenshell.api.pset.edit_pset(file, pset=common, properties={"IsExternal": True})
    assert apply_psets(file, result) == len(result.verdicts)
    assert ifcopenshell.util.element.get_psets(storey)[PSET_NAME]["Status"] == "KEEP"
    for element, verdict in ((first, result.verdicts[0]), (second, result.verdicts[1])):
        sets = [r for r in element.IsDefinedBy if r.RelatingPropertyDefinition.Name == PSET_NAME]
        assert len(sets) == 1
        assert ifcopenshell.util.element.get_psets(element)[PSET_NAME]["Status"] == verdict.status
    assert ifcopenshell.util.element.get_psets(first)["Pset_WallCommon"]["IsExternal"] is True
    used = {p.id() for s in file.by_type("IfcPropertySet") for p in s.HasProperties}
    assert used == {p.id() for p in file.by_type("IfcPropertySingleValue")}


def test_elements_that_are_gone_are_skipped(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    file = ifcopenshell.open(str(tmp_path / "house.ifc"))
    file.remove(file.by_guid(result.verdicts[0].global_id))
    assert apply_psets(file, result) == len(result.verdicts) - 1


def test_input_is_never_written(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    source = tmp_path / "house.ifc"
    (tmp_path / "link.ifc").symlink_to(source)
    before = hashlib.sha256(source.read_bytes()).hexdigest()
    for out in (source, tmp_path / "link.ifc", tmp_path / "." / "house.ifc"):
        with pytest.raises(BimVerifyError, match="input model"):
            write_verified_ifc(source, result, out)
    write_verified_ifc(source, result, tmp_path / "out.ifc")
    assert hashlib.sha256(source.read_bytes()).hexdigest() == before


def test_another_model_is_refused(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    other = make_ifc(tmp_path / "other.ifc")
    with pytest.raises(BimVerifyError, match="none of the verified elements"):
        write_verified_ifc(other, result, tmp_path / "out.ifc")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["house.ifc", "other.ifc"]


def test_full_disk_leaves_nothing(tmp_path: Path) -> None:
    """Whether the IFC library reports the failed write or leaves a file without its last line."""
    resource = pytest.importorskip("resource")
    result = small_result(tmp_path)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(BimVerifyError, match=r"Cannot write .*out\.ifc"):
            write_verified_ifc(tmp_path / "house.ifc", result, tmp_path / "out.ifc")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [p.name for p in tmp_path.iterdir()] == ["house.ifc"]


def test_long_lists_of_scans_fit_a_label(tmp_path: Path) -> None:
    result = replace(small_result(tmp_path), scan_paths=tuple(f"/scans/setup_{i:04d}_west.e57" for i in range(60)))
    write_verified_ifc(tmp_path / "house.ifc", result, tmp_path / "out.ifc")
    source = typed_properties(tmp_path / "out.ifc", result.verdicts[0].global_id)["ScanSource"][1]
    assert len(source) <= 255 and source.startswith("setup_0000_west.e57, ") and source.endswith(" more")
