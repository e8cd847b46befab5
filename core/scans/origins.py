"""Where scanners stood, as the user says it for files that do not: one place for one file, or a place for each by name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from ..errors import BimVerifyError
from ..files import same_file

Origin = tuple[float, float, float]
"""Metres, scan frame."""
Origins = Origin | Mapping[str, Origin] | None
"""One place, or places by file; None: none was given."""


def origin_of(path: str | Path, given: Origins) -> Origin | None:
    """What was given for one file: by its path, else by its name alone."""
    if given is None or not isinstance(given, Mapping):
        return given
    for matches in (same_file, lambda one, other: Path(one).name == other):
        found = [origin for name, origin in given.items() if matches(path, name)]
        if found:
            return found[0]
    return None


def parse_origins(option: str, texts: Sequence[str]) -> Origins:
    """``X,Y,Z`` in metres, or ``FILE=X,Y,Z`` any number of times, as ``option`` takes them."""
    by_file: dict[str, Origin] = {}
    alone: list[Origin] = []
    for text in texts:
        name, _, place = text.rpartition("=")
        if name:
            by_file[name.strip()] = parse_numbers(option, place)
        else:
            alone.append(parse_numbers(option, place))
    if len(alone) > 1 or (alone and by_file):
        raise BimVerifyError(
            f"{option} was given more than once without a file's name; write FILE=X,Y,Z for each file that names no scanner "
            "position."
        )
    return alone[0] if alone else by_file or None


def parse_numbers(option: str, text: str) -> Origin:
    """``X,Y,Z`` in metres, as ``option`` takes it."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise BimVerifyError(f"{option} takes three numbers X,Y,Z in metres, not {text!r}.") from error
    if not all(map(math.isfinite, (x, y, z))):
        raise BimVerifyError(f"{option} takes three finite numbers X,Y,Z in metres, not {text!r}.")
    return x, y, z


def refuse_one_for_several(given: Origins, placed: Iterable[str]) -> None:
    """Refuse one place for more than one of the files ``placed`` by it: their rays would be false."""
    if given is None or isinstance(given, Mapping):
        return
    files: list[str] = []
    for path in placed:
        if not any(same_file(path, other) for other in files):
            files.append(path)
    if len(files) > 1:
        raise BimVerifyError(
            f"{', '.join(Path(p).name for p in files)} name no scanner position, and one was given for all of them; give each "
            f"its own, --origin {Path(files[0]).name}=X,Y,Z --origin {Path(files[1]).name}=X,Y,Z."
        )
