"""What every command checks before it does any work: where it writes, and what a text means."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import BimVerifyError
from ..files import check_writable


def parse_origin(text: str | None) -> tuple[float, float, float] | None:
    """``X,Y,Z`` in metres."""
    if not text:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise BimVerifyError(f"--origin takes three numbers X,Y,Z in metres, not {text!r}.") from error
    return x, y, z


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
    given = {Path(p).resolve() for p in inputs}
    for output in outputs:
        if Path(output).resolve() in given:
            raise BimVerifyError(f"{output} is an input and is never written to; give another name for the output.")


def check_folder(path: str) -> None:
    """Refuse a folder for outputs that is not there and cannot be made, before any work is done."""
    folder = Path(path)
    there = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not there.is_dir():
        raise BimVerifyError(f"Cannot write to the folder {folder}: {there} is a file. Choose another place.")
    if not os.access(there, os.W_OK):
        raise BimVerifyError(f"Cannot write to the folder {folder}: no permission in {there}. Choose another place.")
