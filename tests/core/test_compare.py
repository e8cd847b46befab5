"""Two building models compared: what the lines and the number say, and what is not compared."""

from __future__ import annotations

from pathlib import Path

import ifcopenshell.api.aggregate
import ifcopenshell.api.root
import pytest

from bim_verify.cli import main
from bim_verify.core.reconstruction.compare import Comparison, compare, comparison_lines, comparison_to_json
from bim_verify.core.reconstruction.compare_report import write_comparison_report
from bim_verify.core.reconstruction.shapes import Shapes, shapes_of

from .model_files import ModelFile, at


def two_walls(high: float = 2.6, long: float = 6.0, east: float = 0.0) -> ModelFile:
    """Two walls, 4 m apart, their middles at 3 m east of ``east``."""
    made = ModelFile("IFC4", "m")
    for name, y in (("south", -0.2), ("north", 4.0)):
        made.product("IfcWall", name, made.box(long, 0.2, high), at(x=east + 3.0 - long / 2, y=y))
    return made


def against(a: ModelFile, b: ModelFile) -> Comparison:
    return compare(shapes_of(a.file), shapes_of(b.file))


@pytest.mark.parametrize(("other", "said"), [
    (two_walls(high=1.4), "height 1200.0 (at most 1200.0) mm"), (two_walls(long=3.0), "length 3000.0 (at most 3000.0) mm"),
])  # fmt: skip
def test_what_the_number_does_not_see_is_in_the_lines(other: ModelFile, said: str) -> None:
    result = against(two_walls(), other)
    *lines, number = comparison_lines(result)
    assert said in " ".join(lines)
    assert result.quality == pytest.approx(0.0, abs=1e-7) and "equal" not in number and "heights do not" in number
    walls = comparison_to_json(result)["classes"]["walls"]
    assert max(walls["length_max_m"], walls["height_max_m"]) > 1.0


def test_of_a_class_that_the_reference_does_not_have_no_share_is_told(tmp_path: Path) -> None:
    more = two_walls()
    more.product("IfcColumn", "c", more.box(0.3, 0.3, 2.6), at(x=3, y=2))
    result = against(more, two_walls())
    assert "columns: 1 found, none in the reference." in comparison_lines(result)
    page = write_comparison_report(tmp_path, result, "a.ifc", "b.ifc").read_text(encoding="utf-8")
    row = page[page.index("<tbody>") :]
    row = row[row.index("columns") :].split("</tr>")[0]
    assert "1" in row and "0.0" not in row


def test_a_round_column_turned_about_its_axis_is_the_same() -> None:
    def column(turn: float) -> Shapes:
        made = ModelFile("IFC4", "m")
        made.product("IfcColumn", "c", made.round_column(0.2, 2.6), at(x=3, y=2, turn_deg=turn))
        return shapes_of(made.file)

    for turn in (0.0, 5.0, 20.0, 37.0):
        match = compare(column(turn), column(0.0)).classes["columns"].matches[0]
        assert match.angle < 1e-6 and match.size < 1e-3 and match.middle < 1e-6 and match.quality < 1e-6


def test_elements_without_a_body_are_compared_by_their_parts_or_counted() -> None:
    reference = two_walls()
    file = reference.file
    whole = ifcopenshell.api.root.create_entity(file, ifc_class="IfcWall", name="layered")
    ifcopenshell.api.root.create_entity(file, ifc_class="IfcWall", name="no body")
    ifcopenshell.api.root.create_entity(file, ifc_class="IfcCurtainWall", name="front")
    parts = [
        reference.product("IfcBuildingElementPart", f"layer {k}", reference.box(0.1, 3.8, 2.6), at(x=0.1 * k), into=False)
        for k in range(2)
    ]
    ifcopenshell.api.aggregate.assign_object(file, products=parts, relating_object=whole)
    result = against(two_walls(), reference)
    assert result.classes["walls"].reference == 3 and [s.name for s in result.classes["walls"].missed] == ["layered"]
    assert result.classes["walls"].missed[0].width == pytest.approx(0.2, abs=1e-6)
    assert "Not compared, of the reference: walls without a shape: 1, curtain walls: 1." in comparison_lines(result)
    assert comparison_to_json(result)["notes"] == list(result.notes)


def test_models_in_different_frames_are_said_to_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here, there = two_walls().write(tmp_path / "a.ifc"), two_walls(east=1000.0).write(tmp_path / "b.ifc")
    assert main(["compare", str(here), str(there)]) == 0
    assert "do not overlap: the middle of the first lies -1000.0, 0.0, 0.0 m" in capsys.readouterr().out
    assert not against(two_walls(), two_walls(east=1.0)).notes


def test_pairs_name_their_storey(tmp_path: Path) -> None:
    page = write_comparison_report(tmp_path / "r", against(two_walls(), two_walls()), "a.ifc", "b.ifc").read_text("utf-8")
    storey = two_walls().file.by_type("IfcBuildingStorey")[0].Name
    assert f"south, {storey}" in page


def test_help_offers_a_scene_only_where_there_is_something_to_show(capsys: pytest.CaptureFixture[str]) -> None:
    for command, offered in (("compare", False), ("verify", True)):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert ("--blend" in capsys.readouterr().out) is offered
