"""Facades: corners to metres, windows and doors of painted photos, footprints, the mock-up's IFC file."""

from __future__ import annotations

import json
from pathlib import Path

import ifcopenshell
import ifcopenshell.validate
import numpy as np
import pytest
from PIL import Image

from bim_verify.cli import main
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.facade.classify import floors, group_types, kind_of
from bim_verify.core.facade.correct import corrected
from bim_verify.core.facade.find_facade import find_corners
from bim_verify.core.facade.footprint import read_footprint
from bim_verify.core.facade.mockup import mockup, mockup_file, write_mockup
from bim_verify.core.facade.records import Facade, FacadeBox
from bim_verify.core.facade.rectify import aspect_ratio, order_corners
from bim_verify.core.facade.report import facade_to_plain
from bim_verify.core.jobs.facade import FacadeOptions, facade, read_color
from bim_verify.core.model.load import load_model
from bim_verify.core.reconstruction.shapes import read_shapes

from .facade_data import Photo, photo_of
from .templates import check_templates


def read(photo: Photo, **known: float) -> Facade:
    (found,) = facade([photo.path], FacadeOptions(corners=(photo.corners,), **known))
    return found


def overlaps(found: Facade, photo: Photo) -> np.ndarray:
    """(found, true) intersection over union."""
    a = np.array([[b.x0, b.z0, b.x1, b.z1] for b in found.boxes])[:, None]
    b = np.array([photo.plan.box(e) for e in photo.plan.elements])[None]
    both = np.prod(np.clip(np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2]), 0, None), axis=2)
    return both / (np.prod(a[..., 2:] - a[..., :2], axis=2) + np.prod(b[..., 2:] - b[..., :2], axis=2) - both)


@pytest.mark.parametrize("seed", [1, 3, 5, 7, 9, 11])
def test_openings_of_every_style_are_found(seed: int, tmp_path: Path) -> None:
    photo = photo_of(tmp_path, seed)
    found = read(photo, width=photo.plan.width)
    iou = overlaps(found, photo)
    assert (iou.max(axis=0) > 0.5).mean() >= 0.9
    assert (iou.max(axis=1) > 0.5).mean() >= 0.9
    for box, row in zip(found.boxes, iou, strict=True):
        if row.max() > 0.5:
            truth = photo.plan.types[photo.plan.elements[int(row.argmax())].type]
            assert box.kind == truth.kind
    assert len(found.levels) == len(photo.plan.levels)
    assert found.arrangement_x == ("connected" if photo.plan.style == "ribbon" else "separated")


def test_one_known_length_sets_the_scale(tmp_path: Path) -> None:
    photo = photo_of(tmp_path, 1)
    wide, high = read(photo, width=photo.plan.width), read(photo, height=photo.plan.height)
    for found in (wide, high):
        assert abs(found.scale.height / photo.plan.height - 1) < max(3 * found.scale.aspect_sigma, 0.01)
        assert 0 < found.scale.relative_sigma < 0.02
        iou = overlaps(found, photo)
        truth = np.array([photo.plan.box(e) for e in photo.plan.elements])[iou.argmax(axis=1)]
        error = [b.width - (t[2] - t[0]) for b, t in zip(found.boxes, truth, strict=True)]
        assert np.median(np.abs(error)) < 0.08
    unknown = read(photo)
    assert unknown.scale.source == "FLOORHEIGHT"
    assert unknown.scale.relative_sigma > 0.1
    assert any("typical floor height" in w for w in unknown.warnings)


def test_aspect_of_an_oblique_rectangle() -> None:
    focal, size = 900.0, (1000, 800)
    turn = np.array([[np.cos(0.5), 0.0, np.sin(0.5)], [0.0, 1.0, 0.0], [-np.sin(0.5), 0.0, np.cos(0.5)]])
    corner = np.array([[-3.0, -2.0, 0.0], [3.0, -2.0, 0.0], [3.0, 2.0, 0.0], [-3.0, 2.0, 0.0]]) @ turn.T + [0.0, -1.0, 10.0]
    pixel = focal * corner[:, :2] / corner[:, 2:] + [499.5, 399.5]
    ratio, sigma = aspect_ratio(pixel, size)
    assert abs(ratio - 4 / 6) < 3 * sigma
    known, better = aspect_ratio(pixel, size, focal)
    assert abs(known - 4 / 6) < 0.01
    assert better <= sigma


def test_corners_in_any_order() -> None:
    ring = np.array([[10.0, 12.0], [200.0, 20.0], [210.0, 150.0], [5.0, 140.0]])
    assert np.array_equal(order_corners(ring[[2, 0, 3, 1]]), ring)
    with pytest.raises(BimVerifyError, match="convex"):
        order_corners(np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0], [30.0, 0.0]]))


def test_corners_are_found_by_the_lines(tmp_path: Path) -> None:
    photo = photo_of(tmp_path, 3)
    found = find_corners(read_color(photo.path)[0], photo.path.name)
    reach = np.ptp(photo.corners, axis=0).max()
    assert np.linalg.norm(found - photo.corners, axis=1).max() < 0.06 * reach


def test_a_photo_without_lines_is_refused() -> None:
    with pytest.raises(BimVerifyError, match="--corners"):
        find_corners(np.full((300, 400, 3), 128, dtype=np.uint8), "grey.png")


def test_kinds_groups_and_floors() -> None:
    assert kind_of(0.05, 2.1) == "door"
    assert kind_of(0.05, 1.2) == "window"
    assert kind_of(0.9, 2.1) == "window"
    boxes = [FacadeBox(0, 1, w, 1 + h, "window") for w, h in ((1.0, 1.5), (1.03, 1.48), (1.6, 1.5), (1.0, 1.52))]
    assert group_types(boxes) == [0, 0, 1, 0]
    levels = floors([(0.9, 2.3), (0.0, 2.1), (3.9, 5.3), (3.9, 5.3), (6.9, 8.3)], 9.2)
    assert len(levels) == 3
    assert levels[0] == 0.0
    assert 2.4 < levels[1] < 3.9


def box_facade(width: float = 10.0, kind: str = "window") -> Facade:
    from bim_verify.core.facade.records import Scale

    boxes = (
        FacadeBox(1.0, 0.9, 2.2, 2.4, "window"),
        FacadeBox(3.0, 0.0, 4.1, 2.2, "door", 0.5),
        FacadeBox(1.0, 3.9, 2.2, 5.4, "window", 0.3),
    )
    scale = Scale(width, 6.0, "WIDTH", 0.002, 0.01)
    return Facade(
        "front.jpg",
        boxes,
        (0.0, 3.0),
        scale,
        "separated",
        "separated",
        np.zeros((4, 2)),
        np.zeros((60, 100, 3), dtype=np.uint8),
    )


def test_the_mockup_is_a_valid_building_of_typed_openings(tmp_path: Path) -> None:
    path = tmp_path / "mockup.ifc"
    corners = read_footprint("0,0 10,0 10,8 0,8").corners
    write_mockup(path, mockup([box_facade(), box_facade(8.0)], corners))
    file = ifcopenshell.open(str(path))
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(file, logger)
    assert logger.statements == []
    assert [s.Name for s in file.by_type("IfcBuildingStorey")] == ["Storey 0", "Storey 1"]
    assert len(file.by_type("IfcWall")) == 8
    assert len(file.by_type("IfcWindow")) == 4
    assert len(file.by_type("IfcWindowType")) == 2
    assert len(file.by_type("IfcDoorType")) == 1
    assert all(w.IsTypedBy for w in [*file.by_type("IfcWindow"), *file.by_type("IfcDoor")])
    found = read_shapes(path)
    doors = sorted(found["doors"], key=lambda s: s.middle[1])
    # on the south wall its place along x, on the east wall along y
    assert abs(doors[0].middle[0] - 3.55) < 0.01
    assert abs(doors[1].middle[1] - 3.55) < 0.01
    assert abs(doors[0].height - 2.2) < 0.01
    wall = next(w for w in file.by_type("IfcWall") if w.Name == "Wall 1")
    values = {
        p.Name: p.NominalValue.wrappedValue for d in wall.IsDefinedBy
        if d.RelatingPropertyDefinition.Name == "BimVerify_Facade" for p in d.RelatingPropertyDefinition.HasProperties
    }  # fmt: skip
    check_templates(file, "BimVerify_Facade")
    assert values["ScaleSource"] == "WIDTH"
    assert values["Grammar"].startswith("Facade -> split(z) { 3.000 : Floor1 | 3.000 : Floor2 }\nFloor1 -> split(x)")
    assert values["ScaleSigma"] == pytest.approx(0.002)


def test_the_same_photo_gives_the_same_file(tmp_path: Path) -> None:
    for name in ("a.ifc", "b.ifc"):
        write_mockup(tmp_path / name, mockup([box_facade()]), "same.ifc")
    assert (tmp_path / "a.ifc").read_bytes() == (tmp_path / "b.ifc").read_bytes()


def test_no_order_of_chance_in_the_file() -> None:
    """Entities hash by the place of their file in memory: several files that live at once are at several places."""
    corners = read_footprint("0,0 10,0 10,8 0,8").corners
    files = [mockup_file(mockup([box_facade(), box_facade(8.0)], corners)) for _ in range(4)]
    first = files[0].to_string().split("DATA;")[1]
    assert all(f.to_string().split("DATA;")[1] == first for f in files[1:])
    (storeys,) = (r for r in files[0].by_type("IfcRelAggregates") if r.RelatingObject.is_a("IfcBuilding"))
    assert [s.Name for s in storeys.RelatedObjects] == ["Storey 0", "Storey 1"]
    for contained in files[0].by_type("IfcRelContainedInSpatialStructure"):
        numbers = [e.id() for e in contained.RelatedElements]
        assert numbers == sorted(numbers)
        for element in contained.RelatedElements:
            fills = getattr(element, "FillsVoids", ())
            parent = fills[0].RelatingOpeningElement if fills else contained.RelatingStructure
            assert element.ObjectPlacement.PlacementRelTo == parent.ObjectPlacement


def test_a_corrected_mockup_has_the_new_boxes() -> None:
    plain = facade_to_plain(box_facade())
    made = corrected([plain], [[FacadeBox(5.0, 0.9, 6.0, 2.4, "window")]], None)
    (opening,) = made.building.storeys[0].walls[0].openings
    assert (opening.u0, opening.u1) == (5.0, 6.0)
    with pytest.raises(BimVerifyError, match="No window or door"):
        corrected([plain], [[]], None)


def test_footprints(tmp_path: Path) -> None:
    clockwise = read_footprint("0,0 0,5 8,5 8,0")
    assert "clockwise" in clockwise.notes[0]
    assert clockwise.place is None
    assert np.array_equal(clockwise.corners, [[0, 0], [8, 0], [8, 5], [0, 5]])
    path = tmp_path / "plan.geojson"
    path.write_text(
        '{"type":"Polygon","coordinates":[[[11.0,48.0],[11.0001,48.0],[11.0001,48.0001],[11.0,48.0001],[11.0,48.0]]]}'
    )
    ring = read_footprint(str(path)).corners
    assert np.linalg.norm(ring[1] - ring[0]) == pytest.approx(7.45, abs=0.05)
    for bad in ("0,0 1,1", "0,0 5,5 5,0 0,5", "a,b c,d e,f"):
        with pytest.raises(BimVerifyError):
            read_footprint(bad)
    path.write_text('{"type":"Point","coordinates":[1,2]}')
    with pytest.raises(BimVerifyError, match="no polygon"):
        read_footprint(str(path))


def test_one_outline_is_a_footprint_several_are_not(tmp_path: Path) -> None:
    square = [[0, 0], [900, 0], [900, 900], [0, 900], [0, 0]]
    hole = [[300, 300], [600, 300], [600, 600], [300, 600], [300, 300]]
    path = tmp_path / "plan.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [square, hole]}))
    outline = read_footprint(str(path))
    assert len(outline.corners) == 4
    assert "courtyard" in outline.notes[0]
    path.write_text(json.dumps({"type": "MultiPolygon", "coordinates": [[square], [[[x + 2000, y] for x, y in square]]]}))
    with pytest.raises(BimVerifyError, match="2 outlines"):
        read_footprint(str(path))


def test_map_coordinates_stay_out_of_the_geometry(tmp_path: Path) -> None:
    """UTM: the model lies near its zero, and says where that is; read back, its corner is where the footprint has it."""
    plan, path = tmp_path / "plan.geojson", tmp_path / "mockup.ifc"
    ring = [[691000.25, 5334000.5], [691010.25, 5334000.5], [691010.25, 5334008.5], [691000.25, 5334008.5]]
    plan.write_text(json.dumps({
        "type": "Polygon", "coordinates": [[*ring, ring[0]]],
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}},
    }))  # fmt: skip
    outline = read_footprint(str(plan))
    assert not outline.notes
    assert np.abs(outline.corners).max() < 20
    write_mockup(path, mockup([box_facade()], outline.corners, outline.place))
    file = ifcopenshell.open(str(path))
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(file, logger)
    assert logger.statements == []
    assert max(abs(c) for p in file.by_type("IfcCartesianPoint") for c in p.Coordinates) < 20
    model = load_model(path)
    assert model.map_conversion is not None
    assert model.map_conversion.name == "EPSG:25832"
    low = model.bounds[0] + model.origin
    assert model.map_conversion.to_map(low[None])[0, :2] == pytest.approx(ring[0], abs=1e-3)
    near = read_footprint("691000,5334000 691010,5334000 691010,5334008")
    assert near.place is not None
    assert "not named" in near.notes[0]
    assert read_footprint("691000,5334000 691010,5334000 691010,5334008", "EPSG:25832").notes == ()


def test_a_photo_is_read_upright_and_corners_outside_it_are_refused(tmp_path: Path) -> None:
    photo = photo_of(tmp_path, 1)
    turned = tmp_path / "turned.png"
    with Image.open(photo.path) as image:
        exif = image.getexif()
        exif[0x0112] = 6  # shown turned by a quarter to the right
        image.transpose(Image.Transpose.ROTATE_90).save(turned, exif=exif)
    assert np.array_equal(read_color(turned)[0], read_color(photo.path)[0])
    with pytest.raises(BimVerifyError, match="outside the photo"):
        facade([photo.path], FacadeOptions(corners=(photo.corners + 5000.0,), width=10.0))


def test_corners_found_by_lines_are_marked_and_less_sure(tmp_path: Path) -> None:
    photo = photo_of(tmp_path, 3)
    given = read(photo, width=photo.plan.width)
    (found,) = facade([photo.path], FacadeOptions(width=photo.plan.width))
    assert (given.corner_source, found.corner_source) == ("GIVEN", "LINES")
    assert found.scale.aspect_sigma > 3 * given.scale.aspect_sigma
    assert found.scale.relative_sigma > 3 * given.scale.relative_sigma


@pytest.mark.parametrize(
    "options", [["--footprint", "0,0 9,0 9,9 0,9", "--width", "9"], ["--width", "9", "--floor-height", "3"]]
)
def test_two_lengths_that_contradict_are_refused(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    photo, out = photo_of(tmp_path, 1), tmp_path / "out.ifc"
    corners = ["--corners", ",".join(f"{v:.1f}" for v in photo.corners.ravel())]
    assert main(["facade", str(photo.path), *corners, *options, "--out", str(out), "--quiet"]) == 1
    assert "leave" in capsys.readouterr().err
    assert not out.exists()


def test_a_corner_left_of_the_photo_is_no_option(tmp_path: Path) -> None:
    photo, out = photo_of(tmp_path, 1), tmp_path / "out.ifc"
    corners = ",".join(f"{v:.1f}" for v in [-2.0, *photo.corners.ravel()[1:]])
    assert main(["facade", str(photo.path), "--corners", corners, "--width", "9", "--out", str(out), "--quiet"]) == 0
