"""The commands as users run them: real processes, their exit codes, their one line on stderr, and what they leave behind."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import pty
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.util.element
import numpy as np
import pytest

import bim_verify
from bim_verify.core.model.load import load_model
from bim_verify.core.scans.campaign import Station
from bim_verify.core.scans.write_e57 import write_e57
from bim_verify.core.simulation.campaign import Campaign, set_up, write_campaign
from bim_verify.core.simulation.scanner import Scanner

from ..core.factory import make_ifc
from ..core.model_files import ModelFile

TIMEOUT_S = 120
SCANNER = Scanner("test", math.radians(1.5), sigma_range=0.0015, sigma_angle=0.0)
STAND = np.array([2.0, 1.5, 1.4])
QUICK = ("--spacing-mm", "150", "--quiet")


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model and a scan of it, and the same scan wrong in several ways."""
    folder = tmp_path_factory.mktemp("data")
    model = load_model(make_ifc(folder / "model.ifc"), cache=False, threads=1)
    stand = STAND - model.origin
    write_campaign(Campaign(model, SCANNER, (set_up("S", stand, 1, 0),), {}, (), 1), folder)
    off = dataclasses.replace(model, origin=model.origin + np.array([1000.0, 0.0, 0.0]))
    write_campaign(Campaign(off, SCANNER, (set_up("S", stand, 1, 0),), {}, (), 1), folder / "off")
    whole = (folder / "scan.e57").read_bytes()
    (folder / "truncated.e57").write_bytes(whole[: len(whole) // 2])
    (folder / "empty.e57").write_bytes(b"")
    write_e57(folder / "no_points.e57", [Station("S", STAND)], [])
    (folder / "text.ifc").write_text("This is no model.")
    ModelFile().write(folder / "nothing.ifc")
    np.savetxt(folder / "cloud.xyz", np.random.default_rng(0).uniform(0, 3, (500, 3)), fmt="%.4f")
    return folder


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Where a test's outputs go, beside a folder for everything temporary."""
    for name in ("out", "tmp"):
        (tmp_path / name).mkdir()
    return tmp_path


def environment(place: Path) -> dict[str, str]:
    paths = [str(Path(bim_verify.__file__).parent.parent), os.environ.get("PYTHONPATH", "")]
    return {
        **os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p), "TMPDIR": str(place / "tmp"),
        "BIM_VERIFY_CACHE": str(place / "cache"), "PYTHONWARNINGS": "ignore",
    }  # fmt: skip


def run(place: Path, *arguments: object, limits: Callable[[], None] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "bim_verify", *map(str, arguments)], cwd=place, env=environment(place), text=True,
        capture_output=True, timeout=TIMEOUT_S, check=False, preexec_fn=limits,
    )  # fmt: skip


def left(place: Path) -> list[str]:
    """Everything in the outputs' and the temporary folder."""
    return sorted(str(p.relative_to(place)) for name in ("out", "tmp") for p in (place / name).rglob("*"))


def says_one_sentence(done: subprocess.CompletedProcess[str], code: int, *words: str) -> None:
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1 and done.stderr.startswith("bim-verify: "), done.stderr
    assert "Traceback" not in done.stderr and "Unexpected" not in done.stderr
    for word in words:
        assert word in done.stderr


def test_verify_writes_everything_that_was_asked_for(data: Path, place: Path) -> None:
    before = (data / "model.ifc").read_bytes(), (data / "scan.e57").read_bytes()
    out = place / "out"
    done = run(
        place, "verify", data / "model.ifc", data / "scan.e57", "--out", out / "verified.ifc", "--json", out / "found.json",
        "--samples", out / "samples.ply", "--report", out / "report", *QUICK,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "5 elements at LOA30" in done.stdout and str(out / "verified.ifc") in done.stdout
    assert (data / "model.ifc").read_bytes() == before[0] and (data / "scan.e57").read_bytes() == before[1]

    found = json.loads((out / "found.json").read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    file = ifcopenshell.open(str(out / "verified.ifc"))
    assert [v["global_id"] for v in found["verdicts"]] == found["elements"] and len(found["elements"]) == 5
    statuses = {
        ifcopenshell.util.element.get_pset(file.by_guid(v["global_id"]), "BimVerify_Verification", "Status"): v["status"]
        for v in found["verdicts"]
    }
    assert all(written == said for written, said in statuses.items()) and "CONFIRMED" in statuses
    assert (out / "samples.ply").read_bytes().startswith(b"ply\nformat binary_little_endian 1.0\n")
    assert list((out / "report").glob("*.html")) and list((out / "report").glob("*.csv"))
    names = [n for n in left(place) if not n.startswith("out/report/")]
    assert names == ["out/found.json", "out/report", "out/samples.ply", "out/verified.ifc"]
    assert not [n for n in left(place) if n.startswith("tmp/") or "/." in n], "nothing temporary is left"


@pytest.mark.parametrize(
    ("model", "scan", "words"),
    [
        ("text.ifc", "scan.e57", ("text.ifc is not an IFC file",)),
        ("nothing.ifc", "scan.e57", ("nothing.ifc has no", "nothing to verify")),
        ("missing.ifc", "scan.e57", ("Cannot read", "missing.ifc")),
        ("model.ifc", "truncated.e57", ("truncated.e57",)),
        ("model.ifc", "empty.e57", ("empty.e57 is empty",)),
        ("model.ifc", "no_points.e57", ("no_points.e57",)),
        ("model.ifc", "off/scan.e57", ("scan.e57", "from it")),
        ("model.ifc", "missing.e57", ("Cannot read", "missing.e57")),
        ("model.ifc", "model.ifc", ("model.ifc",)),
        ("model.ifc", "cloud.xyz", ("cloud.xyz names no scanner position", "--origin")),
    ],
)
def test_bad_input_is_said_in_one_sentence(
    model: str, scan: str, words: tuple[str, ...], data: Path, place: Path
) -> None:
    done = run(
        place, "verify", data / model, data / scan, "--out", place / "out" / "verified.ifc", "--json",
        place / "out" / "found.json", *QUICK,
    )  # fmt: skip
    says_one_sentence(done, 1, *words)
    assert left(place) == []


@pytest.mark.parametrize("option", ["--out", "--json", "--samples", "--report"])
@pytest.mark.parametrize("where", ["missing/there", "file/there", "input", "folder"])
def test_outputs_that_cannot_be_written(option: str, where: str, data: Path, place: Path) -> None:
    (place / "file").write_text("in the way")
    shutil.copy(data / "model.ifc", place / "model.ifc")
    before = (place / "model.ifc").read_bytes()
    if option == "--report" and where != "file/there":
        pytest.skip("a report makes its folder, or takes one that is there")
    target = {"input": place / "model.ifc", "folder": place}.get(where, place / where)
    options = {"--out": place / "out" / "verified.ifc"} | {option: target}
    arguments = [word for pair in options.items() for word in pair]
    done = run(place, "verify", place / "model.ifc", data / "scan.e57", *arguments, *QUICK)
    says_one_sentence(done, 1, str(target))
    assert left(place) == []
    assert (place / "model.ifc").read_bytes() == before and (place / "file").read_text() == "in the way"


@pytest.mark.parametrize("option", ["--samples", "--json", "--report"])
def test_one_name_for_two_outputs(option: str, data: Path, place: Path) -> None:
    target = place / "out" / "both"
    done = run(place, "verify", data / "model.ifc", data / "scan.e57", "--out", target, option, target, *QUICK)
    says_one_sentence(done, 1, "two outputs")
    assert left(place) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(data: Path, place: Path) -> None:
    (place / "out").chmod(0o500)
    done = run(place, "verify", data / "model.ifc", data / "scan.e57", "--out", place / "out" / "verified.ifc", *QUICK)
    says_one_sentence(done, 1, "no permission")


@pytest.mark.parametrize("option", ["--out", "--json", "--samples", "--report"])
def test_a_full_disk_leaves_nothing(option: str, data: Path, place: Path) -> None:
    """Files that may grow to no more than a few kilobytes stand for a disk that fills up while writing.

    All outputs are asked for, so those that would still fit must not appear either.
    """
    size = {"--out": 4000, "--json": 3000, "--samples": 60_000, "--report": 60_000}[option]
    out = place / "out"
    options = {"--out": out / "verified.ifc"} | {option: out / "big"}
    done = run(
        place, "verify", data / "model.ifc", data / "scan.e57", *[w for pair in options.items() for w in pair], *QUICK,
        limits=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
    )  # fmt: skip
    says_one_sentence(done, 1, "Cannot write")
    assert left(place) == []


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_interrupting_leaves_nothing(data: Path, place: Path, sent: signal.Signals) -> None:
    command = [
        sys.executable, "-m", "bim_verify", "verify", str(data / "model.ifc"), str(data / "scan.e57"), "--out",
        str(place / "out" / "verified.ifc"), "--json", str(place / "out" / "found.json"), "--spacing-mm", "4",
        "--memory-gb", "0.0001",
    ]  # fmt: skip
    process = subprocess.Popen(
        command, cwd=place, env=environment(place), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        deadline = time.monotonic() + TIMEOUT_S
        while not list((place / "tmp").glob("bim_verify_*/*")) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(sent)
        stdout, stderr = process.communicate(timeout=TIMEOUT_S)
    finally:
        process.kill()
    says_one_sentence(subprocess.CompletedProcess(command, process.returncode, stdout, stderr), 130, "Interrupted")
    assert left(place) == []


@pytest.mark.parametrize(
    "arguments",
    [
        (), ("nothing",), ("verify",), ("verify", "a.ifc", "b.e57"),
        ("verify", "a.ifc", "b.e57", "--out", "c.ifc", "--loa", "33"),
        ("verify", "a.ifc", "b.e57", "--out", "c.ifc", "--threads", "many"), ("info",), ("info", "a.e57", "--unknown"),
    ],
)  # fmt: skip
def test_wrong_usage(arguments: tuple[str, ...], place: Path) -> None:
    done = run(place, *arguments)
    assert done.returncode == 2 and done.stdout == ""
    assert "usage: bim-verify" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("option", "value"),
    [("--origin", "1,2"), ("--origin", "a,b,c"), ("--sigma-mm", "0"), ("--spacing-mm", "-1"), ("--memory-gb", "0"),
     ("--sigma-mm", "nan"), ("--spacing-mm", "nan"), ("--origin", "nan,0,0"), ("--threads", "-1"),
     ("--registration-sigma-mm", "-3")],
)  # fmt: skip
def test_values_that_make_no_sense(option: str, value: str, data: Path, place: Path) -> None:
    done = run(
        place, "verify", data / "model.ifc", data / "cloud.xyz", "--out", place / "out" / "v.ifc", f"{option}={value}",
        "--quiet",
    )  # fmt: skip
    says_one_sentence(done, 1, option.removeprefix("--") if option != "--origin" else "origin")
    assert left(place) == []


@pytest.mark.parametrize("quiet", [True, False])
def test_progress_is_shown_on_a_terminal_unless_quiet(quiet: bool, data: Path, place: Path) -> None:
    ours, theirs = pty.openpty()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "bim_verify", "verify", data / "model.ifc", data / "scan.e57", "--out",
             place / "out" / "verified.ifc", "--spacing-mm", "150", *(["--quiet"] if quiet else [])],
            cwd=place, env={**environment(place), "TERM": "xterm"}, stdout=subprocess.PIPE, stderr=theirs, timeout=TIMEOUT_S,
            check=False,
        )  # fmt: skip
        os.set_blocking(ours, False)
        try:
            shown = os.read(ours, 1_000_000)
        except BlockingIOError:
            shown = b""
    finally:
        os.close(ours)
        os.close(theirs)
    assert done.returncode == 0
    assert (shown == b"") == quiet, shown


def test_info_says_what_files_hold(data: Path, place: Path) -> None:
    done = run(place, "info", data / "model.ifc", data / "scan.e57", "--json", place / "out" / "info.json")
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert "IFC4" in done.stdout and "3 IfcWall" in done.stdout and "scan.e57" in done.stdout
    files: list[dict[str, Any]] = json.loads((place / "out" / "info.json").read_text())["files"]
    assert [f["format"] for f in files] == ["IFC", "E57"]
    assert files[0]["elements"] == {"IfcColumn": 1, "IfcSlab": 1, "IfcWall": 3}


def test_a_reader_that_has_gone_is_no_error(data: Path, place: Path) -> None:
    command = [sys.executable, "-m", "bim_verify", "info", str(data / "model.ifc")]
    process = subprocess.Popen(command, cwd=place, env=environment(place), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait(TIMEOUT_S) == 0


@pytest.mark.parametrize("name", ["empty.e57", "truncated.e57", "missing.e57", "text.ifc"])
def test_info_on_what_cannot_be_read(name: str, data: Path, place: Path) -> None:
    says_one_sentence(run(place, "info", data / name), 1, name)


def test_simulated_scan_is_verified(data: Path, place: Path) -> None:
    stations = place / "stations.json"
    stations.write_text(json.dumps({"scanner": {"preset": "fast", "angular_step_deg": 1.5}, "stations": [STAND.tolist()]}))
    scan = place / "out" / "scan.e57"
    done = run(place, "simulate", data / "model.ifc", "--stations", stations, "--out", scan, "--quiet")
    assert done.returncode == 0 and "returns" in done.stdout, done.stderr
    done = run(place, "verify", data / "model.ifc", scan, "--out", place / "out" / "verified.ifc", *QUICK)
    assert done.returncode == 0 and "CONFIRMED" in done.stdout, done.stderr


def test_version() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bim_verify", "--version"], capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
        env={**os.environ, "PYTHONPATH": str(Path(bim_verify.__file__).parent.parent)},
    )  # fmt: skip
    assert done.stdout.strip() == f"bim-verify {bim_verify.__version__}"
