"""What commands check before any work, and how little they load for it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from bim_verify.core.commands import COMMANDS
from bim_verify.core.commands.checks import check_report, input_options, larger_than_zero, parse_place, zero_or_more
from bim_verify.core.errors import BimVerifyError

HEAVY = ("numba", "scipy", "jinja2", "ifcopenshell", "matplotlib", "shapely")


def test_the_table_of_commands_loads_no_heavy_library() -> None:
    code = f"import sys, bim_verify.core.commands; print(sorted(set({HEAVY!r}) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_number_that_must_be_larger_than_zero(value: float) -> None:
    with pytest.raises(BimVerifyError, match="--sigma-mm must be a number larger than zero"):
        larger_than_zero({"sigma_mm": value}, "sigma_mm")


def test_zero_and_nothing_given_pass_where_they_may() -> None:
    zero_or_more({"a": 0.0, "b": None}, "a", "b")
    larger_than_zero({"b": None}, "b")
    with pytest.raises(BimVerifyError, match="--a must be zero or more"):
        zero_or_more({"a": -0.1}, "a")


def test_common_options_are_checked_for_every_command() -> None:
    values = {"origin": ["1,2,3"], "threads": 0, "memory_gb": 2.0, "no_cache": True}
    assert input_options(values) == {"origin": (1.0, 2.0, 3.0), "threads": 0, "memory_gb": 2.0, "cache": False}
    with pytest.raises(BimVerifyError, match="--threads"):
        input_options(values | {"threads": -1})
    with pytest.raises(BimVerifyError, match="--memory-gb"):
        input_options(values | {"memory_gb": 0.0})
    with pytest.raises(BimVerifyError, match="--near takes three numbers"):
        parse_place("--near", "1,2")


def test_a_report_never_replaces_an_input_or_another_output(tmp_path: Path) -> None:
    page = tmp_path / "index.html"
    page.write_text("mine", encoding="utf-8")
    with pytest.raises(BimVerifyError, match="is an input"):
        check_report(str(tmp_path), ("index.html",), [str(page)], [])
    with pytest.raises(BimVerifyError, match="named for two outputs"):
        check_report(str(tmp_path), ("index.html",), [], [str(tmp_path)])


def test_every_command_has_a_headless_script() -> None:
    scripts = Path(__file__).resolve().parent.parent.parent / "scripts"
    assert [c.name for c in COMMANDS if not (scripts / f"{c.name}.py").is_file()] == []
