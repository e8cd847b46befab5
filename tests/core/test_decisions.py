"""A person's decisions: written into the IFC, found again by a later run, taken back; the computed verdict stays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import ifcopenshell
import ifcopenshell.util.element
import pytest

from bim_verify.core.commands.decide import COMMAND
from bim_verify.core.commands.earlier import earlier_decisions, still_there
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.model.decisions import apply_decisions, decisions_in, read_decisions, remove_decision
from bim_verify.core.model.write_psets import write_verified_ifc
from bim_verify.core.progress import Progress
from bim_verify.core.results import Decision

from .factory import make_ifc, small_result
from .templates import check_templates

WORD = Decision("CONFIRMED", "Behind the <shelf> & ' seen on site", "Ä. Modeller", "2026-01-02", "ABSENT")


@pytest.mark.parametrize("schema", ["IFC2X3", "IFC4", "IFC4X3_ADD2"])
def test_a_decision_survives_a_re_run(tmp_path: Path, schema: str) -> None:
    result = small_result(tmp_path, schema=schema)
    absent = next(v for v in result.verdicts if v.status == "ABSENT")
    house, out = tmp_path / "house.ifc", tmp_path / "verified.ifc"
    write_verified_ifc(house, replace(result, decisions={absent.global_id: WORD}), out)
    file = ifcopenshell.open(str(out))
    psets = ifcopenshell.util.element.get_psets(file.by_guid(absent.global_id))
    assert psets["BimVerify_Verification"]["Status"] == "ABSENT"
    assert psets["BimVerify_Decision"]["Status"] == "CONFIRMED"
    for name in ("BimVerify_Verification", "BimVerify_Decision"):
        check_templates(file, name)

    again = earlier_decisions(str(house), str(out), None)
    assert still_there(again, result) == {absent.global_id: WORD}
    write_verified_ifc(house, replace(result, decisions=again), out)
    assert decisions_in(out) == {absent.global_id: WORD}
    assert decisions_in(house) == {}
    write_verified_ifc(out, result, tmp_path / "third.ifc")  # the verified file as the model of the next run
    assert decisions_in(tmp_path / "third.ifc") == {absent.global_id: WORD}


def test_a_decision_is_replaced_and_taken_back(tmp_path: Path) -> None:
    file = ifcopenshell.open(str(make_ifc(tmp_path / "house.ifc")))
    walls = [w.GlobalId for w in file.by_type("IfcWall")]
    before = len(list(file))
    assert apply_decisions(file, {walls[0]: WORD, walls[1]: WORD, "0000000000000000000000": WORD}) == 2
    apply_decisions(file, {walls[0]: replace(WORD, status="DEVIATING")})
    assert {g: d.status for g, d in read_decisions(file).items()} == {walls[0]: "DEVIATING", walls[1]: "CONFIRMED"}
    for wall in walls:
        remove_decision(file, wall)
    assert read_decisions(file) == {}
    assert len(list(file)) <= before + 2  # an owner history at most


def test_nonsense_in_the_set_is_passed_over(tmp_path: Path) -> None:
    file = ifcopenshell.open(str(make_ifc(tmp_path / "house.ifc")))
    wall = file.by_type("IfcWall")[0].GlobalId
    apply_decisions(file, {wall: replace(WORD, status="MAYBE")})  # type: ignore[arg-type]
    assert read_decisions(file) == {}


def test_chosen_decisions_come_from_that_file_only(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    ids = [v.global_id for v in result.verdicts]
    write_verified_ifc(tmp_path / "house.ifc", replace(result, decisions={ids[0]: WORD}), tmp_path / "a.ifc")
    write_verified_ifc(tmp_path / "house.ifc", replace(result, decisions={ids[1]: WORD}), tmp_path / "b.ifc")
    chosen = earlier_decisions(str(tmp_path / "house.ifc"), str(tmp_path / "a.ifc"), str(tmp_path / "b.ifc"))
    assert set(chosen) == {ids[1]}


def decide(model: Path, out: Path, *elements: str, status: str = "CONFIRMED", reason: str = "seen") -> None:
    """``bim-verify decide`` with these values."""
    values = {"model": str(model), "out": str(out), "element": list(elements), "status": status, "reason": reason, "by": "me"}
    outcome = COMMAND.run(values, Progress())
    assert outcome.write is not None
    outcome.write()


def test_the_command_decides_and_takes_back(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    write_verified_ifc(tmp_path / "house.ifc", result, tmp_path / "verified.ifc")
    absent = next(v.global_id for v in result.verdicts if v.status == "ABSENT")
    decide(tmp_path / "verified.ifc", tmp_path / "decided.ifc", absent)
    (decision,) = decisions_in(tmp_path / "decided.ifc").values()
    assert (decision.status, decision.reason, decision.author, decision.computed) == ("CONFIRMED", "seen", "me", "ABSENT")
    decide(tmp_path / "decided.ifc", tmp_path / "back.ifc", absent, status="COMPUTED", reason="")
    assert decisions_in(tmp_path / "back.ifc") == {}


def test_the_command_refuses_what_makes_no_sense(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    plain, verified = tmp_path / "house.ifc", tmp_path / "verified.ifc"
    write_verified_ifc(plain, result, verified)
    element, out = result.verdicts[0].global_id, tmp_path / "out.ifc"
    with pytest.raises(BimVerifyError, match="--reason"):
        decide(verified, out, element, reason=" ")
    with pytest.raises(BimVerifyError, match="carries no verdict"):
        decide(plain, out, element)
    with pytest.raises(BimVerifyError, match="has no element"):
        decide(verified, out, "0000000000000000000000")
    with pytest.raises(BimVerifyError, match="is an input"):
        decide(verified, verified, element)
    assert not out.exists()
