"""Displaced elements to where they stand, by their local placements alone, and back again."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.api.aggregate
import ifcopenshell.api.feature
import ifcopenshell.api.geometry
import ifcopenshell.guid
import ifcopenshell.util.element
import ifcopenshell.util.placement
import ifcopenshell.validate
import numpy as np
import pytest

from bim_verify.cli import main
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import verify
from bim_verify.core.model.load import load_model
from bim_verify.core.model.property_sets import ElementProperties, put_property_sets
from bim_verify.core.model.write_psets import PSET_NAME as VERIFICATION
from bim_verify.core.model.write_psets import write_verified_ifc
from bim_verify.core.options import VerifyOptions
from bim_verify.core.simulation.campaign import Campaign, scan_to_files, set_up
from bim_verify.core.simulation.scanner import PRESETS
from bim_verify.core.simulation.scene import Edit
from bim_verify.core.update.update import FOLLOWS, KEPT, OWN, PSET_NAME, undo_file, update_file, update_lines

from .model_files import SCHEMAS, UNITS_M, ModelFile, at
from .templates import check_templates

SHIFT = np.array([0.03, -0.02, 0.01])


def room(schema: str = "IFC4", unit: str = "mm") -> tuple[ModelFile, dict[str, Any]]:
    """A turned storey far away: slab, walls, a column, a partition with a door in its opening and a lamp that hangs on it."""
    made = ModelFile(schema, unit)
    base = at(1000.0, 2000.0, 30.0, 30.0)
    made.place(made.storey, base)
    things = {
        "floor": made.product("IfcSlab", "floor", made.box(6.0, 4.0, 0.2), base @ at(z=-0.2)),
        "south": made.product("IfcWall", "south", made.box(6.0, 0.2, 2.6), base @ at(y=-0.2)),
        "north": made.product("IfcWall", "north", made.box(6.0, 0.2, 2.6), base @ at(y=4.0)),
        "west": made.product("IfcWall", "west", made.box(0.2, 4.0, 2.6), base @ at(x=-0.2)),
        "partition": made.product("IfcWall", "partition", made.box(0.15, 4.0, 2.6), base @ at(x=4.0)),
        "column": made.product("IfcColumn", "column", made.box(0.3, 0.3, 2.6), base @ at(x=1.5, y=2.8, turn_deg=20.0)),
    }
    hole = made.opening(things["partition"], made.box(0.35, 0.9, 2.1), base @ at(x=3.9, y=1.0))
    door = made.product("IfcDoor", "door", made.box(0.06, 0.9, 2.1), base @ at(x=4.04, y=1.0))
    ifcopenshell.api.feature.add_filling(made.file, opening=hole, element=door)
    lamp = made.product("IfcBuildingElementProxy", "lamp", made.box(0.1, 0.1, 0.1), base @ at(x=3.9, y=3.0, z=1.8))
    lamp.ObjectPlacement.PlacementRelTo = things["partition"].ObjectPlacement
    lamp.ObjectPlacement.RelativePlacement = made.file.create_entity(
        "IfcAxis2Placement3D",
        made.file.create_entity("IfcCartesianPoint", [v * made.scale for v in (-0.1, 3.0, 1.8)]),
    )
    return made, {**things, "opening": hole, "door": door, "lamp": lamp}


def found_displaced(file: Any, product: Any, shift: np.ndarray, status: str = "DEVIATING", significant: bool = True) -> None:
    values: dict[str, Any] = {"Status": ("IfcLabel", status), "Significant": ("IfcBoolean", significant)}
    values |= {f"Displacement{axis}": ("IfcLengthMeasure", float(v)) for axis, v in zip("XYZ", shift, strict=True)}
    put_property_sets(file, VERIFICATION, [ElementProperties(product.GlobalId, product.id(), values)])


def world(product: Any, unit: str = "mm") -> np.ndarray:
    """(4, 4), metres."""
    matrix = np.array(ifcopenshell.util.placement.get_local_placement(product.ObjectPlacement), dtype=np.float64)
    matrix[:3, 3] *= UNITS_M[unit]
    return matrix


def complaints(path: Path) -> list[str]:
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(str(path), logger)
    return sorted(f"{s['level']} {s['message']}" for s in logger.statements)


def kinds(result: Any) -> dict[str, str]:
    return {u.name: u.kind for u in result.updates}


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("unit", list(UNITS_M))
def test_a_wall_takes_its_opening_and_door_along_and_leaves_the_rest(schema: str, unit: str) -> None:
    made, things = room(schema, unit)
    before = {name: world(p, unit) for name, p in things.items()}
    found_displaced(made.file, things["partition"], SHIFT)
    found_displaced(made.file, things["column"], SHIFT, significant=False)
    found_displaced(made.file, things["north"], SHIFT, status="CONFIRMED")
    result = update_file(made.file)
    assert kinds(result) == {"partition": OWN, "Opening": FOLLOWS, "door": FOLLOWS, "lamp": KEPT}
    for name, product in things.items():
        expected = before[name].copy()
        expected[:3, 3] += SHIFT if name in ("partition", "opening", "door") else 0.0
        np.testing.assert_allclose(world(product, unit), expected, atol=1e-9)
    check_templates(made.file, PSET_NAME)
    record = ifcopenshell.util.element.get_psets(things["partition"])[PSET_NAME]
    assert record["MovedX"] * UNITS_M[unit] == pytest.approx(SHIFT[0])
    assert len(undo_file(made.file).updates) >= 2
    for name, product in things.items():
        np.testing.assert_allclose(world(product, unit), before[name], atol=1e-9)
        assert PSET_NAME not in ifcopenshell.util.element.get_psets(product)


def test_a_door_that_moved_alone_takes_its_opening(tmp_path: Path) -> None:
    made, things = room()
    before = {name: world(p) for name, p in things.items()}
    found_displaced(made.file, things["door"], SHIFT)
    assert kinds(update_file(made.file)) == {"door": OWN, "Opening": FOLLOWS}
    for name in ("door", "opening"):
        np.testing.assert_allclose(world(things[name])[:3, 3], before[name][:3, 3] + SHIFT, atol=1e-9)
    np.testing.assert_array_equal(world(things["partition"]), before["partition"])


def test_a_door_and_its_wall_go_their_own_ways() -> None:
    made, things = room()
    before = {name: world(p) for name, p in things.items()}
    found_displaced(made.file, things["partition"], SHIFT)
    found_displaced(made.file, things["door"], -SHIFT)
    update_file(made.file)
    np.testing.assert_allclose(world(things["partition"])[:3, 3], before["partition"][:3, 3] + SHIFT, atol=1e-9)
    np.testing.assert_allclose(world(things["door"])[:3, 3], before["door"][:3, 3] - SHIFT, atol=1e-9)


def test_a_shared_placement_is_split_and_shared_axes_stay() -> None:
    made, things = room()
    column, north = things["column"], things["north"]
    north.ObjectPlacement = column.ObjectPlacement
    things["south"].ObjectPlacement.RelativePlacement = column.ObjectPlacement.RelativePlacement
    before = {name: world(p) for name, p in things.items()}
    found_displaced(made.file, column, SHIFT)
    update_file(made.file)
    np.testing.assert_allclose(world(column)[:3, 3], before["column"][:3, 3] + SHIFT, atol=1e-9)
    for name in ("north", "south"):
        np.testing.assert_array_equal(world(things[name]), before[name])
    undo_file(made.file)
    np.testing.assert_allclose(world(column), before["column"], atol=1e-9)


def test_the_same_displacement_is_not_applied_twice_and_a_second_one_is_undone_to_the_plan() -> None:
    made, things = room()
    column = things["column"]
    before = world(column)
    found_displaced(made.file, column, SHIFT)
    update_file(made.file)
    again = update_file(made.file)
    assert not again.updates
    assert "before" in again.notes[0]
    np.testing.assert_allclose(world(column)[:3, 3], before[:3, 3] + SHIFT, atol=1e-9)
    found_displaced(made.file, column, 2 * SHIFT)
    update_file(made.file)
    np.testing.assert_allclose(world(column)[:3, 3], before[:3, 3] + 3 * SHIFT, atol=1e-9)
    undo_file(made.file)
    np.testing.assert_allclose(world(column), before, atol=1e-9)


def test_undo_works_in_the_world_whatever_placements_hang_on_by_then() -> None:
    """As another program leaves them that gives every product it touches a new parent, at the same place."""
    made, things = room()
    planned = {name: world(p) for name, p in things.items()}
    found_displaced(made.file, things["partition"], SHIFT)
    update_file(made.file)
    for name in ("lamp", "door", "partition"):
        place = world(things[name])
        ifcopenshell.api.geometry.edit_object_placement(made.file, product=things[name], matrix=place.copy(), is_si=True)
        np.testing.assert_allclose(world(things[name]), place, atol=1e-6)
    undo_file(made.file)
    for name, place in planned.items():
        np.testing.assert_allclose(world(things[name]), place, atol=1e-6, err_msg=name)


def test_projections_and_coverings_follow_and_so_does_a_whole_of_which_all_parts_moved() -> None:
    made, things = room()
    f, base = made.file, at(1000.0, 2000.0, 30.0, 30.0)
    nose = made.product("IfcProjectionElement", "nose", made.box(0.1, 0.5, 0.5), base @ at(x=4.15, y=2.0), into=False)
    guid = ifcopenshell.guid.new
    f.create_entity(
        "IfcRelProjectsElement", GlobalId=guid(), RelatingElement=things["partition"], RelatedFeatureElement=nose
    )
    plaster = made.product("IfcCovering", "plaster", made.box(0.01, 4.0, 2.6), base @ at(x=4.15))
    f.create_entity(
        "IfcRelCoversBldgElements", GlobalId=guid(), RelatingBuildingElement=things["partition"], RelatedCoverings=[plaster]
    )
    parts = [made.product("IfcBuildingElementPart", n, made.box(0.1, 4.0, 2.6), base @ at(x=4.0)) for n in ("core", "skin")]
    ifcopenshell.api.aggregate.assign_object(f, products=parts, relating_object=things["partition"])
    things |= {"nose": nose, "plaster": plaster, "core": parts[0], "skin": parts[1]}
    before = {name: world(p) for name, p in things.items()}
    found_displaced(f, parts[0], SHIFT)
    found_displaced(f, parts[1], SHIFT)
    assert update_file(f).notes == ()
    for name in ("core", "skin", "partition", "opening", "door", "nose", "plaster"):
        np.testing.assert_allclose(world(things[name])[:3, 3] - before[name][:3, 3], SHIFT, atol=1e-6, err_msg=name)
    undo_file(f)
    for name, place in before.items():
        np.testing.assert_allclose(world(things[name]), place, atol=1e-6, err_msg=name)


def test_what_was_found_at_the_other_place_does_not_stay_on_what_is_put_back() -> None:
    made, things = room()
    column, door = things["column"], things["door"]
    found_displaced(made.file, column, SHIFT)
    found_displaced(made.file, things["partition"], SHIFT)
    found_displaced(made.file, door, 0.0 * SHIFT, status="CONFIRMED")
    (note,) = update_file(made.file).notes
    assert "door" in note and "CONFIRMED" in note
    kept = ifcopenshell.file.from_string(made.file.to_string())
    assert undo_file(kept).notes == ()
    assert all(VERIFICATION in ifcopenshell.util.element.get_psets(kept.by_guid(p.GlobalId)) for p in (column, door))
    found_displaced(made.file, column, 0.0 * SHIFT, status="CONFIRMED")  # verified anew where it was moved to
    (note,) = undo_file(made.file).notes
    assert "removed" in note
    assert all(VERIFICATION not in ifcopenshell.util.element.get_psets(p) for p in (column, door))


def test_a_displacement_that_no_verification_finds_is_not_believed_and_all_notes_are_counted() -> None:
    made, things = room()
    names = [name for name in things if things[name].is_a("IfcWall") or name in ("floor", "column")]
    for name in names:
        found_displaced(made.file, things[name], np.array([1e30, 0.0, 0.0]))
    before = {name: world(things[name]) for name in names}
    result = update_file(made.file)
    assert not result.updates and len(result.notes) == len(names) == 6
    assert f"column ({things['column'].GlobalId}) is said to stand 1e+30 m" in " ".join(result.notes)
    assert all((world(things[name]) == before[name]).all() for name in names)
    lines = update_lines(result)
    assert len(lines) == 7 and "1 more notes" in lines[-1]


def test_nothing_to_do_is_said() -> None:
    made, _ = room()
    with pytest.raises(BimVerifyError, match="verify"):
        update_file(made.file)
    with pytest.raises(BimVerifyError, match="nothing to undo"):
        undo_file(made.file)


@pytest.mark.parametrize(("schema", "unit"), [("IFC4", "mm"), ("IFC2X3", "foot")])
def test_an_updated_model_is_confirmed_by_the_same_scan(tmp_path: Path, schema: str, unit: str) -> None:
    made, things = room(schema, unit)
    plan = made.write(tmp_path / "plan.ifc")
    model = load_model(plan, cache=False)
    row = {e.name: k for k, e in enumerate(model.elements)}
    along = tuple(float(v) for v in at(turn_deg=30.0)[:3, 0])
    edits = {row["partition"]: Edit("shift", 0.04, along), row["column"]: Edit("shift", 0.03, along)}
    places = [at(1000.0, 2000.0, 30.0, 30.0) @ np.array([*p, 1.0]) for p in ((0.9, 1.0, 1.4), (2.8, 3.0, 1.6), (2.7, 0.8, 1.2))]
    set_ups = tuple(set_up(f"S{k}", p[:3] - model.origin, 1, k) for k, p in enumerate(places))
    scanner = replace(PRESETS["fast"], angular_step=math.radians(0.7))
    scan = scan_to_files(Campaign(model, scanner, set_ups, edits, (), 1), tmp_path / "scan.e57", None).scan_path
    options = VerifyOptions(sample_spacing=0.15, sigma=0.0015, cache=False)
    first = verify(model, [scan], options)
    status = {v.name: v for v in first.verdicts}
    assert status["partition"].status == status["column"].status == "DEVIATING"
    write_verified_ifc(plan, first, tmp_path / "verified.ifc")
    source = (tmp_path / "verified.ifc").read_bytes()
    out, data = tmp_path / "updated.ifc", tmp_path / "out.json"
    assert main(["update", str(tmp_path / "verified.ifc"), "--out", str(out), "--json", str(data), "--report",
                 str(tmp_path / "moved")]) == 0
    assert "partition" in (tmp_path / "moved" / "index.html").read_text(encoding="utf-8")
    assert (tmp_path / "verified.ifc").read_bytes() == source
    moved = {u["name"]: u for u in json.loads(data.read_text())["updates"]}
    assert {"partition", "column"} <= set(moved)
    second = {v.name: v for v in verify(load_model(out, cache=False), [scan], options).verdicts}
    for name in ("partition", "column"):
        assert second[name].status == "CONFIRMED", second[name].reason
        assert (second[name].displacement or 0.0) < 0.002
    assert complaints(out) == complaints(plan)
    back = tmp_path / "back.ifc"
    assert main(["update", str(out), "--out", str(back), "--undo", "--report", str(tmp_path / "undone")]) == 0
    assert "put back" in (tmp_path / "undone" / "index.html").read_text(encoding="utf-8")
    reopened = ifcopenshell.open(str(back))
    for name in ("partition", "column", "opening", "door", "lamp"):
        product = things[name]
        np.testing.assert_allclose(world(reopened.by_guid(product.GlobalId), unit), world(product, unit), atol=1e-9)


def test_bad_input_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made, _ = room()
    plan = made.write(tmp_path / "plan.ifc")
    assert main(["update", str(plan), "--out", str(tmp_path / "out.ifc")]) == 1
    assert "bim-verify verify" in capsys.readouterr().err
    assert main(["update", str(plan), "--out", str(plan)]) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["plan.ifc"]
