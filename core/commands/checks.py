"""What every command checks before it does any work: where it writes, and what a text means."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from ..errors import BimVerifyError
from ..files import check_writable, same_file
from ..scans.origins import Origin, parse_numbers, parse_origins


def parse_place(option: str, text: str | None) -> Origin | None:
    """``X,Y,Z`` in metres, as ``option`` takes it."""
    return parse_numbers(option, text) if text else None


def larger_than_zero(values: dict[str, Any], *keys: str) -> None:
    """Refuse numbers that are not finite and larger than zero; one that was not given passes."""
    for key in keys:
        if values[key] is not None and not 0 < values[key] < math.inf:
            raise BimVerifyError(f"{_option(key)} must be a number larger than zero, not {values[key]:g}.")


def zero_or_more(values: dict[str, Any], *keys: str) -> None:
    """Refuse numbers that are not finite and at least zero; one that was not given passes."""
    for key in keys:
        if values[key] is not None and not 0 <= values[key] < math.inf:
            raise BimVerifyError(f"{_option(key)} must be zero or more, not {values[key]:g}.")


def input_options(values: dict[str, Any]) -> dict[str, Any]:
    """What the common arguments say of ``options.InputOptions``, checked."""
    larger_than_zero(values, "memory_gb")
    threads = checked_threads(values)
    frame = {"scan_frame": values["frame"]} if "frame" in values else {}
    return {
        **frame, "origin": parse_origins("--origin", values["origin"] or ()), "threads": threads,
        "memory_gb": values["memory_gb"], "cache": not values["no_cache"],
    }


def checked_threads(values: dict[str, Any]) -> int:
    """``--threads``, zero or more."""
    if values["threads"] < 0:
        raise BimVerifyError(f"--threads must be zero (all) or more, not {values['threads']}.")
    return int(values["threads"])


def _option(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def check_outputs(inputs: list[str], outputs: list[str]) -> None:
    """Refuse outputs that cannot be written, or that are inputs, before any work is done."""
    refuse_inputs(inputs, outputs)
    for number, output in enumerate(outputs):
        check_writable(output)
        refuse_same(output, outputs[:number])


def refuse_same(output: str, others: list[str]) -> None:
    """Refuse one name for two outputs."""
    if Path(output).resolve() in {Path(other).resolve() for other in others}:
        raise BimVerifyError(f"{output} is named for two outputs; give each a name of its own.")


def refuse_inputs(inputs: list[str], outputs: list[str]) -> None:
    """Refuse outputs that are inputs."""
    for output in outputs:
        if any(same_file(output, given) for given in inputs):
            raise BimVerifyError(f"{output} is an input and is never written to; give another name for the output.")


def check_report(folder: str, names: tuple[str, ...], inputs: list[str], outputs: list[str]) -> None:
    """Refuse a report's folder that cannot be written, is another output, or in which ``names`` would replace an input."""
    check_folder(folder)
    refuse_same(folder, outputs)
    refuse_inputs(inputs, [str(Path(folder) / name) for name in names])


def check_folder(path: str) -> None:
    """Refuse a folder for outputs that is not there and cannot be made, before any work is done."""
    folder = Path(path)
    there = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not there.is_dir():
        raise BimVerifyError(f"Cannot write to the folder {folder}: {there} is a file. Choose another place.")
    if not os.access(there, os.W_OK):
        raise BimVerifyError(f"Cannot write to the folder {folder}: no permission in {there}. Choose another place.")
