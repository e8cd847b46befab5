"""A room whose ceiling was not seen: its height is assumed, and that is said wherever it would be given."""

from __future__ import annotations

import csv
from pathlib import Path

import ifcopenshell.util.element
import pytest

from bim_verify.core.dimensions.table import write_dimensions
from bim_verify.core.reconstruction.building import Reconstruction
from bim_verify.core.reconstruction.dimensions import dimension_rows
from bim_verify.core.reconstruction.report import write_reconstruction_report
from bim_verify.core.reconstruction.summary import reconstruction_to_json
from bim_verify.core.reconstruction.write_ifc import building_file

from .box_scan import WALL_M, scanned, walls_around
from .templates import check_templates


@pytest.fixture(scope="module")
def open_above(tmp_path_factory: pytest.TempPathFactory) -> Reconstruction:
    """Walls 2.6 m high about 5 x 4 m, nothing above."""
    t = WALL_M
    slabs = [(-t, -t, -0.25, 5 + t, 4 + t, 0.0)]
    stations = [(1.5, 1.2, 1.5), (3.5, 2.5, 1.5)]
    return scanned(tmp_path_factory.mktemp("open"), walls_around(5.0, 4.0, 0.0, 2.6), slabs, stations)


def test_its_height_has_a_row_without_a_value_and_the_reason(open_above: Reconstruction, tmp_path: Path) -> None:
    write_dimensions(tmp_path / "d.csv", dimension_rows(open_above))
    with (tmp_path / "d.csv").open(encoding="utf-8-sig", newline="") as stream:
        (row,) = [r for r in csv.DictReader(stream) if r["What"] == "height"]
    assert not row["AsBuilt_mm"] and not row["Sigma_mm"] and "No ceiling was seen" in row["Reason"]


def test_the_file_says_that_heights_are_assumed(open_above: Reconstruction) -> None:
    file = building_file(open_above)
    check_templates(file, "BimVerify_Reconstruction")
    for kind in ("IfcWall", "IfcSpace"):
        said = [ifcopenshell.util.element.get_pset(e, "BimVerify_Reconstruction", "HeightSource") for e in file.by_type(kind)]
        assert said and set(said) == {"ASSUMED"}
    (space,) = file.by_type("IfcSpace")
    assert "Height" not in ifcopenshell.util.element.get_psets(space)["Qto_SpaceBaseQuantities"]


def test_the_report_and_the_json_file_say_it(open_above: Reconstruction, tmp_path: Path) -> None:
    page = write_reconstruction_report(tmp_path / "report", open_above, None).read_text(encoding="utf-8")
    assert "not seen" in page and "no ceiling was seen" in page
    (room,) = reconstruction_to_json(open_above)["storeys"][0]["rooms"]
    assert room["height_source"] == "ASSUMED" and room["height"] is None
