"""IFC in: units, placements, what counts as physical, openings, round members, orientation, glass, map conversion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.model.load import load_model

from .model_files import SCHEMAS, ModelFile, area_of, at, bounds_of, corners_of, volume_of


def load(made: ModelFile, folder: Path) -> BuildingModel:
    return load_model(made.write(folder / "model.ifc"), cache=False, threads=1)


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("unit", ["mm", "m", "foot"])
def test_every_schema_and_unit_gives_metres(schema: str, unit: str, tmp_path: Path) -> None:
    made = ModelFile(schema, unit)
    made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5), at(1.0, 2.0, 0.5))
    model = load(made, tmp_path)
    assert (model.schema, model.project_name) == (schema, "Made in a test")
    assert model.length_unit_m == pytest.approx({"mm": 0.001, "m": 1.0, "foot": 0.3048}[unit])
    np.testing.assert_allclose(bounds_of(model, "Wall"), [[1.0, 2.0, 0.5], [5.0, 2.2, 3.0]], atol=1e-6)
    assert [(e.ifc_class, e.name, e.storey) for e in model.elements] == [("IfcWall", "Wall", "Ground")]
    assert model.closed.tolist() == [True] and not model.transparent.any()


@pytest.mark.parametrize("turn", [0.0, 30.0, 137.0])
def test_turned_and_nested_placements(turn: float, tmp_path: Path) -> None:
    made = ModelFile()
    made.place(made.building, at(10.0, 5.0, 0.0, turn))
    made.place(made.storey, at(10.0, 5.0, 3.0, turn))
    place = at(10.0, 5.0, 3.0, turn) @ at(2.0, -1.0, 0.0, 15.0)
    made.product("IfcColumn", "Post", made.box(0.3, 0.4, 2.5), place)
    corners = corners_of(load(made, tmp_path), "Post").reshape(-1, 3)
    back = (corners - place[:3, 3]) @ place[:3, :3]
    np.testing.assert_allclose([back.min(axis=0), back.max(axis=0)], [[0, 0, 0], [0.3, 0.4, 2.5]], atol=1e-6)


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_a_thousand_kilometres_away_keeps_the_shape(unit: str, tmp_path: Path) -> None:
    far = at(1_000_000.0, 5_300_000.0, 400.0, 25.0)
    made = ModelFile(unit=unit)
    made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5), far)
    made.product("IfcColumn", "Post", made.round_column(0.15, 2.5), far @ at(1.0, 1.0))
    model = load(made, tmp_path)
    assert np.abs(model.vertices).max() < 100.0
    np.testing.assert_allclose(model.origin, far[:3, 3], atol=100.0)
    wall = model.vertices[model.triangles[model.triangle_element == 0]].reshape(-1, 3)
    back = (wall - (far[:3, 3] - model.origin)) @ far[:3, :3]
    np.testing.assert_allclose([back.min(axis=0), back.max(axis=0)], [[0, 0, 0], [4.0, 0.2, 2.5]], atol=2e-6)
    near = ModelFile(unit=unit)
    near.product("IfcColumn", "Post", near.round_column(0.15, 2.5))
    assert volume_of(corners_of(model, "Post")) == pytest.approx(volume_of(corners_of(load(near, tmp_path), "Post")), 1e-6)


@pytest.mark.parametrize("schema", SCHEMAS)
def test_openings_are_cut_and_are_no_elements(schema: str, tmp_path: Path) -> None:
    made = ModelFile(schema)
    wall = made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5))
    made.opening(wall, made.box(1.0, 0.4, 1.2), at(1.5, -0.1, 0.9))
    model = load(made, tmp_path)
    assert [e.name for e in model.elements] == ["Wall"]
    corners = corners_of(model, "Wall")
    assert volume_of(corners) == pytest.approx(4.0 * 0.2 * 2.5 - 1.0 * 0.2 * 1.2, rel=1e-6)
    assert area_of(corners) == pytest.approx(
        2 * (4.0 * 2.5 - 1.2) + 2 * 0.2 * (4.0 + 2.5) + 2 * 0.2 * (1.0 + 1.2), rel=1e-6
    )


@pytest.mark.parametrize("schema", SCHEMAS)
def test_spaces_and_annotations_are_left_out_proxies_and_things_on_the_site_are_kept(schema: str, tmp_path: Path) -> None:
    made = ModelFile(schema)
    made.product("IfcSpace", "Room", made.box(3.0, 3.0, 2.5), into=False)
    made.product("IfcAnnotation", "Note", made.box(0.1, 0.1, 0.1))
    made.product("IfcGrid", "Axes", made.box(0.1, 0.1, 0.1))
    made.product("IfcBuildingElementProxy", "Proxy", made.box(1.0, 1.0, 1.0), at(5.0))
    made.product("IfcWall", "On site", made.box(1.0, 0.2, 1.0), at(8.0), into=made.site)
    made.product("IfcSlab", "Nowhere", made.box(1.0, 1.0, 0.2), at(11.0), into=False)
    model = load(made, tmp_path)
    assert {(e.name, e.storey) for e in model.elements} == {("Proxy", "Ground"), ("On site", "Site"), ("Nowhere", "")}
    assert [e.step_id for e in model.elements] == sorted(e.step_id for e in model.elements)


def test_chords_of_a_round_column_stay_within_a_millimetre(tmp_path: Path) -> None:
    made = ModelFile()
    for number, radius in enumerate((0.02, 0.15, 0.5, 2.0)):
        made.product("IfcColumn", f"{radius}", made.round_column(radius, 3.0), at(10.0 * number))
    model = load(made, tmp_path)
    for number, radius in enumerate((0.02, 0.15, 0.5, 2.0)):
        corners = corners_of(model, f"{radius}") - [10.0 * number, 0.0, 0.0]
        side = np.ptp(corners[..., 2], axis=1) > 0.1
        away = np.hypot(corners[..., 0], corners[..., 1])[side]
        np.testing.assert_allclose(away, radius, atol=1e-6)
        chord = 0.5 * (corners[side] + np.roll(corners[side], 1, axis=1))
        assert radius - np.hypot(chord[..., 0], chord[..., 1]).min() <= 1e-3 + 1e-6


def test_normals_point_outward(tmp_path: Path) -> None:
    made = ModelFile()
    made.product("IfcColumn", "Round", made.round_column(0.3, 2.0))
    made.product("IfcSlab", "Box", made.box(2.0, 1.0, 0.3), at(4.0, turn_deg=40.0))
    model = load(made, tmp_path)
    for name in ("Round", "Box"):
        corners = corners_of(model, name)
        middle = corners.reshape(-1, 3).mean(axis=0)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,ij->i", normal, corners.mean(axis=1) - middle) > 0).all()
    assert model.closed.all()
    assert volume_of(corners_of(model, "Box")) == pytest.approx(0.6, rel=1e-6)


def test_an_inside_out_solid_is_turned(tmp_path: Path) -> None:
    made = ModelFile()
    size = 2.0
    points = [(x, y, z) for x in (0.0, size) for y in (0.0, size) for z in (0.0, size)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    scaled = [made.file.create_entity("IfcCartesianPoint", [v * made.scale for v in p]) for p in points]
    for name, inside_out in (("Right", False), ("Wrong", True)):
        faces = []
        for quad in quads:
            order = quad[::-1] if inside_out else quad
            loop = made.file.create_entity("IfcPolyLoop", [scaled[k] for k in order])
            faces.append(made.file.create_entity("IfcFace", [made.file.create_entity("IfcFaceOuterBound", loop, True)]))
        shell = made.file.create_entity("IfcOpenShell", faces)
        made.product(
            "IfcFurnishingElement", name, made.file.create_entity("IfcShellBasedSurfaceModel", [shell]), at(5.0 * inside_out)
        )
    model = load(made, tmp_path)
    assert model.closed.tolist() == [True, True]
    for name in ("Right", "Wrong"):
        assert volume_of(corners_of(model, name)) == pytest.approx(size**3, rel=1e-6)


def test_an_open_sheet_gets_both_sides(tmp_path: Path) -> None:
    made = ModelFile()
    made.product("IfcPlate", "Sheet", made.sheet((0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1)))
    made.product("IfcSlab", "Slab", made.box(1.0, 1.0, 0.2), at(5.0))
    model = load(made, tmp_path)
    assert dict(zip([e.name for e in model.elements], model.closed.tolist(), strict=True)) == {"Sheet": False, "Slab": True}
    corners = corners_of(model, "Sheet")
    assert area_of(corners) == pytest.approx(2 * 2.0, rel=1e-9)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normal[:, 1] > 0).sum() == (normal[:, 1] < 0).sum() == len(corners) / 2


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4"])
def test_glass_is_marked_by_its_style(schema: str, tmp_path: Path) -> None:
    made = ModelFile(schema)
    for number, (name, transparency) in enumerate((("Pane", 0.7), ("Frosted", 0.1), ("Opaque", 0.0))):
        item = made.box(1.0, 0.02, 1.0)
        made.see_through(item, transparency)
        made.product("IfcPlate", name, item, at(2.0 * number))
    made.product("IfcPlate", "Plain", made.box(1.0, 0.02, 1.0), at(9.0))
    model = load(made, tmp_path)
    glass = {e.name: model.transparent[model.triangle_element == row] for row, e in enumerate(model.elements)}
    assert glass["Pane"].all()
    assert not any(glass[name].any() for name in ("Frosted", "Opaque", "Plain"))


@pytest.mark.parametrize("schema", ["IFC4", "IFC4X3"])
@pytest.mark.parametrize(("unit", "scale"), [("mm", 0.001), ("m", 1.0), ("mm", None)])
def test_map_conversion_in_metres(schema: str, unit: str, scale: float | None, tmp_path: Path) -> None:
    made = ModelFile(schema, unit)
    made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5))
    angle = np.radians(30.0)
    made.map_conversion(
        Eastings=450_000.0, Northings=5_300_000.0, OrthogonalHeight=520.0, XAxisAbscissa=float(np.cos(angle)),
        XAxisOrdinate=float(np.sin(angle)), **({"Scale": scale} if scale else {}),
    )  # fmt: skip
    conversion = load(made, tmp_path).map_conversion
    assert conversion is not None and conversion.name == "EPSG:25832"
    there = conversion.to_map(np.array([[2.0, 1.0, 3.0]]))
    expected = [450_000 + 2 * np.cos(angle) - np.sin(angle), 5_300_000 + 2 * np.sin(angle) + np.cos(angle), 523.0]
    np.testing.assert_allclose(there, [expected], atol=1e-6)
    np.testing.assert_allclose(conversion.to_model(there), [[2.0, 1.0, 3.0]], atol=1e-6)


def test_no_map_conversion(tmp_path: Path) -> None:
    made = ModelFile("IFC2X3")
    made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5))
    assert load(made, tmp_path).map_conversion is None


def test_a_product_without_a_surface_is_named_and_left_out(tmp_path: Path) -> None:
    made = ModelFile()
    made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5))
    ends = [made.file.create_entity("IfcCartesianPoint", [v, 0.0, 0.0]) for v in (0.0, 1000.0)]
    lines = made.file.create_entity("IfcGeometricCurveSet", [made.file.create_entity("IfcPolyline", ends)])
    made.product("IfcMember", "Only a line", lines)
    model = load(made, tmp_path)
    assert [e.name for e in model.elements] == ["Wall"]
    assert len(model.skipped) == 1 and "Only a line" in model.skipped[0]


def test_a_product_that_is_shown_by_its_parts_is_not_named_as_left_out(tmp_path: Path) -> None:
    import ifcopenshell.api.aggregate

    made = ModelFile()
    part = made.product("IfcBuildingElementPart", "Layer", made.box(4.0, 0.2, 2.5))
    ends = [made.file.create_entity("IfcCartesianPoint", [v, 0.0, 0.0]) for v in (0.0, 1000.0)]
    lines = made.file.create_entity("IfcGeometricCurveSet", [made.file.create_entity("IfcPolyline", ends)])
    wall = made.product("IfcWall", "Layered wall", lines)
    ifcopenshell.api.aggregate.assign_object(made.file, products=[part], relating_object=wall)
    model = load(made, tmp_path)
    assert [e.name for e in model.elements] == ["Layer"] and model.skipped == ()


@pytest.mark.parametrize("kind", ["text", "header only", "truncated", "empty", "missing", "folder"])
def test_what_is_no_model_is_said_in_one_sentence(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "model.ifc"
    if kind == "text":
        path.write_text("not an ifc")
    elif kind == "header only":
        path.write_text("ISO-10303-21;\nHEADER;\n")
    elif kind == "truncated":
        made = ModelFile()
        made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5))
        made.write(path)
        path.write_bytes(path.read_bytes()[:700])
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "folder":
        path.mkdir()
    with pytest.raises(BimVerifyError, match=r"model\.ifc") as caught:
        load_model(path, cache=False, threads=1)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


@pytest.mark.parametrize("kept", [0.5, 0.9, 0.999])
def test_a_model_that_was_cut_off_is_refused_even_where_it_parses(kept: float, tmp_path: Path) -> None:
    made = ModelFile()
    for number in range(5):
        made.product("IfcWall", f"Wall {number}", made.box(4.0, 0.2, 2.5))
    made.write(tmp_path / "model.ifc")
    whole = (tmp_path / "model.ifc").read_bytes().rstrip()
    (tmp_path / "model.ifc").write_bytes(whole[: int(len(whole) * kept)])
    with pytest.raises(BimVerifyError, match="cut off"):
        load_model(tmp_path / "model.ifc", cache=False, threads=1)


@pytest.mark.parametrize("through", [1, 2])
def test_a_placement_relative_to_itself_is_refused(through: int, tmp_path: Path) -> None:
    made = ModelFile()
    wall = made.product("IfcWall", "Wall", made.box(4.0, 0.2, 2.5))
    origin = made.file.create_entity("IfcCartesianPoint", [0.0, 0.0, 0.0])
    axes = made.file.create_entity("IfcAxis2Placement3D", origin)
    chain = [made.file.create_entity("IfcLocalPlacement", None, axes) for _ in range(through)]
    for placement, parent in zip(chain, chain[1:] + chain[:1], strict=True):
        placement.PlacementRelTo = parent
    wall.ObjectPlacement = chain[0]
    made.file.write(str(tmp_path / "model.ifc"))
    with pytest.raises(BimVerifyError, match="relative to itself"):
        load_model(tmp_path / "model.ifc", cache=False, threads=1)


def test_a_model_without_a_shape_is_refused(tmp_path: Path) -> None:
    made = ModelFile()
    with pytest.raises(BimVerifyError, match="nothing to verify"):
        load(made, tmp_path)
    made.product("IfcSpace", "Room", made.box(3.0, 3.0, 2.5), into=False)
    with pytest.raises(BimVerifyError, match="nothing to verify"):
        load(made, tmp_path)
