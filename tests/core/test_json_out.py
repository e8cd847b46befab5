"""The JSON file: strict, complete, in the order of the samples."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.report.json_out import result_to_json, to_plain, write_json
from bim_verify.core.results import Decision, ElementVerdict

from .factory import small_result


def no_constant(name: str) -> None:
    raise AssertionError(f"{name} is not JSON")


def test_strict_and_complete(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    broken = replace(result.verdicts[0], displacement_sigma=float("inf"), deviation_median=np.float32("nan"))
    result = replace(result, verdicts=(broken, *result.verdicts[1:]))
    write_json(tmp_path / "r.json", result)
    read = json.loads((tmp_path / "r.json").read_bytes().decode("ascii"), parse_constant=no_constant)
    assert read["elements"] == [e.global_id for e in result.model.elements]
    assert [v["global_id"] for v in read["verdicts"]] == read["elements"]
    assert {f.name for f in fields(ElementVerdict)} == set(read["verdicts"][0])
    assert read["verdicts"][0]["displacement_sigma"] is None and read["verdicts"][0]["deviation_median"] is None
    assert read["verdicts"][1]["displacement"] == pytest.approx(0.012)
    assert read["verdicts"][1]["confirmed_ratio"]["30"] == result.verdicts[1].confirmed_ratio[30]
    assert np.array_equal(read["alignment"]["covariance"], result.alignment.covariance)
    assert read["alignment"]["weakest_direction"] == "up (z), 0.6 mm"
    assert read["stations"][1]["registration_sigma"] is None
    assert read["scans"]["dropped"] == {"invalid": 12, "zero": 3}
    assert read["summary"]["ABSENT"] == 1 and read["options"]["loa"] == 30
    assert read == result_to_json(result)


def test_plain_values() -> None:
    value = {1: (np.int32(3), np.bool_(True)), "a": np.array([[1.0, np.nan]]), "b": Path("x")}
    assert to_plain(value) == {"1": [3, True], "a": [[1.0, None]], "b": "x"}


def test_unwritable_place(tmp_path: Path) -> None:
    with pytest.raises(BimVerifyError, match="folder"):
        write_json(tmp_path, small_result(tmp_path))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["house.ifc"]


def test_decisions_stand_beside_the_computed_verdicts(tmp_path: Path) -> None:
    result = small_result(tmp_path)
    first = result.verdicts[0]
    decision = Decision("ABSENT", "taken down", "me", "2026-01-02", first.status)
    read = result_to_json(replace(result, decisions={first.global_id: decision}))
    assert read["summary"]["overruled"] == 1
    assert read["summary"][first.status] == result.count(first.status)
    assert read["verdicts"][0]["status"] == first.status
    assert read["decisions"] == {first.global_id: {
        "status": "ABSENT", "reason": "taken down", "author": "me", "date": "2026-01-02", "computed": first.status,
    }}  # fmt: skip
    assert result_to_json(result)["summary"]["overruled"] == 0
