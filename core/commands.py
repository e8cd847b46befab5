"""One table of commands, from which every face of the program is made.

The console script, ``blender --command bim_verify``, the headless scripts and the operators' settings all take names,
defaults and help from here.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .errors import BimVerifyError
from .files import check_writable, whole_file
from .options import VerifyOptions
from .progress import Progress
from .results import STATUSES, VerificationResult
from .sensing.presets import PRESETS

Values = dict[str, Any]


@dataclass(frozen=True)
class Argument:
    """One argument of a command. A name with a leading ``--`` is an option, another one a file given by position."""

    name: str
    help: str
    kind: type = str
    default: Any = None
    choices: tuple[Any, ...] = ()
    many: bool = False
    required: bool = False
    flag: bool = False

    @property
    def key(self) -> str:
        """Its name in the values handed to the command."""
        return self.name.lstrip("-").replace("-", "_").lower()


@dataclass
class Outcome:
    """What a command found: lines for a person, data for ``--json``, and the verification for ``--blend``."""

    lines: list[str]
    data: Values = field(default_factory=dict)
    result: VerificationResult | None = None


@dataclass(frozen=True)
class Command:
    """One command: ``run`` takes the arguments' values by key and a progress."""

    name: str
    help: str
    arguments: tuple[Argument, ...]
    run: Callable[[Values, Progress], Outcome]


COMMON = (
    Argument("--json", "write what was found to this file"),
    Argument("--quiet", "show no progress", flag=True),
    Argument("--threads", "processor threads to use (0: all)", int, 0),
    Argument("--memory-gb", "memory for returns, gigabytes; beyond it they go to a temporary file", float, 3.0),
    Argument("--no-cache", "tessellate the model anew and keep nothing", flag=True),
)
DEFAULT = VerifyOptions()
DEMO_SPACING_M = 0.05
"""Query positions of the demo: close enough to look at, and done in a minute."""
MODEL = Argument("MODEL", "IFC file (IFC2X3, IFC4, IFC4X3)", required=True)
SCANS = Argument("SCAN", "E57, LAS/LAZ, PLY, PCD, PTS, PTX, XYZ/CSV or NPY files", many=True, required=True)
ORIGIN = Argument("--origin", "X,Y,Z of the scanner in metres, for scan files that do not name it")


def parse_origin(text: str | None) -> tuple[float, float, float] | None:
    """``X,Y,Z`` in metres."""
    if not text:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise BimVerifyError(f"--origin takes three numbers X,Y,Z in metres, not {text!r}.") from error
    return x, y, z


def verify_options(values: Values) -> VerifyOptions:
    """Options of a verification from a command's values."""
    for key in ("sigma_mm", "spacing_mm", "memory_gb"):
        if not 0 < values[key] < math.inf:
            raise BimVerifyError(f"--{key.replace('_', '-')} must be a number larger than zero, not {values[key]:g}.")
    registration = values["registration_sigma_mm"]
    if registration is not None and not 0 <= registration < math.inf:
        raise BimVerifyError(f"--registration-sigma-mm must be zero or more, not {registration:g}.")
    if values["threads"] < 0:
        raise BimVerifyError(f"--threads must be zero (all) or more, not {values['threads']}.")
    return VerifyOptions(
        loa=values["loa"],
        sigma=values["sigma_mm"] / 1000,
        registration_sigma=None if registration is None else registration / 1000,
        align=values["align"],
        sample_spacing=values["spacing_mm"] / 1000,
        fusion=values["fusion"],
        preset=values["preset"],
        scan_frame=values["frame"],
        origin=parse_origin(values["origin"]),
        threads=values["threads"],
        memory_gb=values["memory_gb"],
        cache=not values["no_cache"],
    )


def _verify(values: Values, progress: Progress) -> Outcome:
    from .jobs import verify
    from .model.write_psets import write_verified_ifc
    from .report.html import write_report
    from .report.json_out import result_to_json
    from .report.samples_ply import write_samples

    options = verify_options(values)
    outputs = [values[key] for key in ("out", "samples") if values[key]]
    _check_outputs([values["model"], *values["scan"]], outputs)
    if values["report"]:
        _check_folder(values["report"])
    result = verify(values["model"], values["scan"], options, progress.part(0.0, 0.85))
    write_verified_ifc(values["model"], result, values["out"])
    if values["samples"]:
        write_samples(values["samples"], result)
    lines = summary_lines(result)
    lines.append(f"Property sets: {values['out']}")
    if values["report"]:
        lines.append(f"Report: {write_report(values['report'], result, progress=progress.part(0.85, 1.0))}")
    return Outcome(lines, result_to_json(result), result)


def summary_lines(result: VerificationResult) -> list[str]:
    """The result in a few lines for a person."""
    summary = result.summary()
    counts = ", ".join(f"{summary[status]} {status}" for status in STATUSES)
    lines = [f"{summary['elements']} elements at LOA{result.options.loa}: {counts}."]
    lines.append(f"{summary['coverage']:.0%} of the exposed surface has evidence from {len(result.stations)} stations.")
    record = result.alignment
    if record.mode != "none":
        lines.append(f"Alignment ({record.mode}): {record.weakest_direction or 'all six directions are fixed'}")
    lines += [f"Note: {warning}" for warning in result.warnings[:5]]
    if len(result.warnings) > 5:
        lines.append(f"Note: {len(result.warnings) - 5} more notes are in the report.")
    return lines


def _check_outputs(inputs: list[str], outputs: list[str]) -> None:
    """Refuse outputs that cannot be written, or that are inputs, before any work is done."""
    given = {Path(p).resolve() for p in inputs}
    for output in outputs:
        if Path(output).resolve() in given:
            raise BimVerifyError(f"{output} is an input and is never written to; give another name for the output.")
        check_writable(output)


def _check_folder(path: str) -> None:
    """Refuse a folder for outputs that is not there and cannot be made, before any work is done."""
    folder = Path(path)
    there = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not there.is_dir():
        raise BimVerifyError(f"Cannot write to the folder {folder}: {there} is a file. Choose another place.")
    if not os.access(there, os.W_OK):
        raise BimVerifyError(f"Cannot write to the folder {folder}: no permission in {there}. Choose another place.")


def _simulate(values: Values, progress: Progress) -> Outcome:
    from .simulation.stations_file import simulate

    outputs = [values["out"]] + ([values["truth"]] if values["truth"] else [])
    _check_outputs([values["model"], values["stations"]], outputs)
    written = simulate(
        values["model"], values["stations"], values["out"], values["truth"], scanner=values["scanner"],
        seed=values["seed"], clutter=values["clutter"], people=values["people"], remove_share=values["remove_share"],
        shift_share=values["shift_share"], threads=values["threads"], cache=not values["no_cache"], progress=progress,
    )
    return Outcome([f"{written.returns:,} returns: {values['out']}"], {"returns": written.returns, "scan": values["out"]})


def _info(values: Values, progress: Progress) -> Outcome:
    from .model.describe import describe_model, format_model, is_ifc
    from .scans.info import describe, format_description

    found, lines = [], []
    for number, path in enumerate(values["file"]):
        progress.update(number / len(values["file"]), f"Reading {Path(path).name}")
        if is_ifc(path):
            found.append(describe_model(path))
            lines.append(format_model(found[-1]))
        else:
            found.append(describe(path))
            lines.append(format_description(found[-1]))
    return Outcome(lines, {"files": found})


def _demo(values: Values, progress: Progress) -> Outcome:
    from .model.write_psets import write_verified_ifc
    from .report.html import write_report
    from .report.json_out import result_to_json
    from .report.samples_ply import write_samples
    from .simulation.demo import make_demo
    from .simulation.score import score

    folder = Path(values["out"])
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BimVerifyError(f"Cannot make the folder {folder}: {error.strerror}. Choose another place.") from error
    files = make_demo(folder, seed=values["seed"], progress=progress.part(0.0, 0.5))
    from .jobs import verify

    options = VerifyOptions(
        sample_spacing=DEMO_SPACING_M, threads=values["threads"], memory_gb=values["memory_gb"],
        cache=not values["no_cache"],
    )
    result = verify(files.model, [files.scan], options, progress.part(0.5, 0.9))
    write_verified_ifc(files.model, result, folder / "house_verified.ifc")
    write_samples(folder / "samples.ply", result)
    page = write_report(folder / "report", result, progress=progress.part(0.9, 1.0))
    data = result_to_json(result)
    with whole_file(folder / "result.json") as temporary:
        temporary.write_text(json.dumps(data, indent=1, allow_nan=False), encoding="utf-8")
    truth = score(result, json.loads(files.truth.read_text(encoding="utf-8")))
    lines = [
        f"A simulated scan of the demo house as it was built: {files.returns:,} returns, {files.scan}",
        *summary_lines(result),
        f"Against the truth: {truth.right} of {truth.scored} verdicts right; median error of a shift "
        f"{1000 * truth.shift_error_median:.1f} mm.",
        f"Model with property sets: {folder / 'house_verified.ifc'}",
        f"Report: {page}",
    ]
    return Outcome(lines, data, result)


COMMANDS: tuple[Command, ...] = (
    Command(
        "verify",
        "say for every element whether the scans confirm it, contradict it, or never saw it",
        (
            MODEL,
            SCANS,
            Argument("--out", "IFC file to write, with a property set on every element", required=True),
            Argument("--loa", "required level of accuracy", int, DEFAULT.loa, (10, 20, 30, 40, 50)),
            Argument("--sigma-mm", "standard deviation of one return along its ray, millimetres", float, 2.5),
            Argument(
                "--registration-sigma-mm",
                "standard deviation of a station's position, millimetres (default: from the stations' agreement)",
                float,
            ),
            Argument(
                "--align", "bring the scans to the model first: fine from a coarse pose, auto without one",
                str, DEFAULT.align, ("none", "fine", "auto"),
            ),
            Argument("--spacing-mm", "distance between query positions, millimetres", float, 20.0),
            Argument(
                "--fusion", "rule that combines the returns", str, DEFAULT.fusion,
                ("station", "dempster", "yager", "dubois-prade"),
            ),
            Argument("--preset", "parameters of the belief masses", str, DEFAULT.preset, ("derived", *sorted(PRESETS))),
            Argument("--frame", "frame the scans are in", str, DEFAULT.scan_frame, ("auto", "model", "map")),
            ORIGIN,
            Argument("--samples", "PLY file of all query positions with their evidence"),
            Argument("--report", "folder for the report (one HTML page, one CSV)"),
            *COMMON,
        ),
        _verify,
    ),
    Command(
        "simulate",
        "scan a model with a simulated terrestrial scanner",
        (
            MODEL,
            Argument("--stations", "JSON file of scanner positions", required=True),
            Argument("--out", "E57 file to write", required=True),
            Argument("--truth", "JSON file for the truth per element"),
            Argument("--scanner", "scanner preset (default: the stations file's, or fast)"),
            Argument("--seed", "seed of noise and choices", int, 0),
            Argument("--clutter", "boxes that are not in the model", int, 0),
            Argument("--people", "people standing around", int, 0),
            Argument("--remove-share", "share of the elements left out", float, 0.0),
            Argument("--shift-share", "share of the elements moved", float, 0.0),
            *COMMON,
        ),
        _simulate,
    ),
    Command(
        "info",
        "say what IFC and scan files hold",
        (Argument("FILE", "IFC or scan files", many=True, required=True), *COMMON),
        _info,
    ),
    Command(
        "demo",
        "make a small house, scan it with a simulated scanner, and verify it",
        (
            Argument("--out", "folder to write to", str, "demo"),
            Argument("--seed", "seed of the simulated scan", int, 1),
            *COMMON,
        ),
        _demo,
    ),
)
