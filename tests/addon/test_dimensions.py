"""Dimensions as built from inside Blender: the table, the section of the report, and Bonsai's file in memory."""

from __future__ import annotations

import csv
from pathlib import Path

import bpy
import pytest

from ..core.room_files import DEEP, OUT_M, write_room
from .stand_in_bonsai import bonsai_holding

ops = bpy.ops.bim_verify


def test_the_table_and_the_report_have_what_was_built(blender: bpy.types.Scene, tmp_path: Path) -> None:
    write_room(tmp_path)
    blender.bim_verify.display_vertices = 10_000
    blender.bim_verify.spacing_mm, blender.bim_verify.sigma_mm = 50, 1
    ops.import_ifc(filepath=str(tmp_path / "room.ifc"))
    ops.import_scan(filepath=str(tmp_path / "room.e57"))
    assert ops.verify() == {"FINISHED"}

    assert ops.export_dimensions(filepath=str(tmp_path / "d")) == {"FINISHED"}
    rows = list(csv.DictReader((tmp_path / "d.csv").read_text(encoding="utf-8-sig").splitlines()))
    assert f"d.csv, {len(rows)} lines" in blender.bim_verify.exported_path
    (across,) = (r for r in rows if r["What"] == "width" and set(r["Between"].split("; ")) == {"south", "north"})
    assert across["Where"] == "'=1+1"
    assert float(across["Planned_mm"]) == pytest.approx(1000 * DEEP, abs=0.01)
    assert abs(float(across["AsBuilt_mm"]) - 1000 * (DEEP + OUT_M)) < 3 * float(across["Sigma_mm"])
    for asked in (False, True):
        assert ops.report(filepath=str(tmp_path / f"r{asked}"), dimensions=asked) == {"FINISHED"}
        page = (tmp_path / f"r{asked}" / "index.html").read_text(encoding="utf-8")
        assert ("Dimensions as built" in page) == asked

    with bonsai_holding(tmp_path / "room.ifc") as ifc:  # its file in memory says where the rooms are
        ifc.file.by_type("IfcSpace")[0].Name = "renamed and not saved"
        assert ops.export_dimensions(filepath=str(tmp_path / "live.csv")) == {"FINISHED"}
    assert "renamed and not saved" in (tmp_path / "live.csv").read_text(encoding="utf-8-sig")


def test_without_rooms_and_openings_there_is_one_sentence(verified: bpy.types.Scene, tmp_path: Path) -> None:
    before = verified.bim_verify.exported_path
    with pytest.raises(RuntimeError, match="No room or opening of the model was seen"):
        ops.export_dimensions(filepath=str(tmp_path / "d.csv"))
    assert (list(tmp_path.iterdir()), verified.bim_verify.exported_path) == ([], before)
