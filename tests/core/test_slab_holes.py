"""A hole of a slab is told from what was not scanned: rays pass the slab's level there."""

from __future__ import annotations

from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import ifcopenshell.validate
import numpy as np
import pytest

from bim_verify.core.reconstruction.building import Reconstruction
from bim_verify.core.reconstruction.dimensions import dimension_rows
from bim_verify.core.reconstruction.shapes import read_shapes
from bim_verify.core.reconstruction.write_ifc import write_reconstruction, written_building

from .box_scan import WALL_M, Box, scanned, walls_around
from .templates import check_templates

HOLE = (2.0, 0.5, 4.0, 1.7)
UNDER_THE_HOLE = (3.0, 1.1, 1.5)


def building(folder: Path, middle: list[Box], *more: tuple[float, float, float]) -> Reconstruction:
    """Two storeys of 6 x 5 m, floors at 0 and 3 m, rooms 2.7 m high, nothing on the stairs."""
    t = WALL_M
    slabs = [(-t, -t, -0.25, 6 + t, 5 + t, 0.0), (-t, -t, 5.7, 6 + t, 5 + t, 6.0), *middle]
    walls = [*walls_around(6.0, 5.0, 0.0, 2.7), *walls_around(6.0, 5.0, 3.0, 5.7)]
    return scanned(folder, walls, slabs, [(1.2, 3.5, 1.5), (4.8, 3.0, 1.5), (4.5, 3.5, 4.5), (1.5, 3.0, 4.5), *more])


def around(x0: float, y0: float, x1: float, y1: float) -> list[Box]:
    """The slab between the storeys in pieces about a hole."""
    t = WALL_M
    return [
        (-t, -t, 2.7, x0, 5 + t, 3.0), (x1, -t, 2.7, 6 + t, 5 + t, 3.0), (x0, -t, 2.7, x1, y0, 3.0),
        (x0, y1, 2.7, x1, 5 + t, 3.0),
    ]


@pytest.fixture(scope="module", params=[(), (UNDER_THE_HOLE,)], ids=["beside", "under"])
def stair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    return building(tmp_path_factory.mktemp("stair"), around(*HOLE), *request.param)


def test_a_hole_lies_where_rays_pass_and_the_storeys_stay_whole(stair: Reconstruction) -> None:
    lower, upper = stair.storeys
    (hole,) = upper.slab_holes
    x, y = stair.origin[:2]
    off = np.add(hole.outline.bounds, [x, y, x, y]) - HOLE
    assert hole.edge_sigma < 0.03 and np.abs(off).max() < 2 * hole.edge_sigma and np.median(np.abs(off)) < 0.002
    assert hole.size is not None and np.abs(np.subtract(hole.size, (2.0, 1.2))).max() < 3 * max(hole.size_sigma)
    assert [round(r.ceiling - r.floor, 2) for s in stair.storeys for r in s.rooms] == [2.7, 2.7]
    assert all(r.outline.area == pytest.approx(30.0, abs=0.05) for s in stair.storeys for r in s.rooms)
    assert not lower.slab_holes and any("open over 2.4 m2" in w for w in stair.warnings)


def test_it_is_an_opening_of_the_slab(stair: Reconstruction, tmp_path: Path) -> None:
    write_reconstruction(tmp_path / "o.ifc", stair)
    file = ifcopenshell.open(str(tmp_path / "o.ifc"))
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(file, logger)
    assert not logger.statements
    check_templates(file, "BimVerify_Reconstruction")
    (opening,) = [o for o in file.by_type("IfcOpeningElement") if o.VoidsElements[0].RelatingBuildingElement.is_a("IfcSlab")]
    said = ifcopenshell.util.element.get_pset(opening, "BimVerify_Reconstruction")
    assert 0.0 < said["PositionSigma"] < 0.03 and said["Quality"] > 0.9
    _, (_, ids) = written_building(stair)
    rows = [r for r in dimension_rows(stair, [ids, ids]) if "floor opening" in r.where]
    assert {r.global_id for r in rows} == {opening.GlobalId} and [r.what for r in rows] == ["length", "width"]
    assert read_shapes(tmp_path / "o.ifc").left_out == {"openings that are in no wall": 1}


def test_a_hole_that_is_no_rectangle_has_an_outline_and_no_size(tmp_path: Path) -> None:
    x0, y0, x1, y1 = HOLE
    pieces = [*around(x0, y0, x1, y1 + 1.2), (x0, y1, 2.7, x0 + 1.0, y1 + 1.2, 3.0)]
    found = building(tmp_path, pieces)
    (hole,) = found.storeys[1].slab_holes
    assert hole.size is None and hole.outline.area == pytest.approx(2.4 + 1.2, abs=0.3) and hole.edge_sigma >= 0.05
    rows = [r for r in dimension_rows(found) if "floor opening" in r.where]
    assert len(rows) == 2 and all(r.value is None and r.reason for r in rows)
