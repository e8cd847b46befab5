"""What every job begins with: a model, a campaign in the model's frame, the threads it may use, a stopwatch."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import BimVerifyError
from ..imagery.block_points import BlockPoints
from ..model.elements import BuildingModel
from ..model.load import load_model
from ..options import InputOptions
from ..progress import Progress
from ..scans.campaign import ScanSource
from ..scans.frame import to_model_frame
from ..scans.open import Campaign, open_scans
from ..scans.origins import refuse_one_for_several
from ..scans.stated_origin import impossible_stations


def open_model(model: BuildingModel | str | Path, options: InputOptions, progress: Progress) -> BuildingModel:
    """The model itself, or what is read from the IFC file."""
    if isinstance(model, BuildingModel):
        return model
    return load_model(model, threads=options.threads, cache=options.cache, progress=progress)


def open_campaign(
    model: BuildingModel, scans: ScanSource | Sequence[str | Path], options: InputOptions
) -> ScanSource:
    """The scans, files or already opened, in the model's frame.

    Raises BimVerifyError when a station has no position, or one at which no scanner can have stood.
    """
    return open_with_blocks(model, scans, options)[0]


def open_with_blocks(
    model: BuildingModel, scans: ScanSource | Sequence[str | Path], options: InputOptions
) -> tuple[ScanSource, tuple[BlockPoints, ...]]:
    """The same, and the blocks of photos among the scans, as their files have them."""
    source = opened(scans, options)
    check_stations(source)
    check_origins(source)
    blocks = source.photo_blocks if isinstance(source, Campaign) else ()
    return to_model_frame(model, source, options.scan_frame), blocks


def opened(scans: ScanSource | Sequence[str | Path], options: InputOptions) -> ScanSource:
    """The scans as their files have them."""
    return open_scans(scans, origin=options.origin) if isinstance(scans, Sequence) else scans


@dataclass
class Stopwatch:
    """Seconds per stage."""

    seconds: dict[str, float] = field(default_factory=dict)
    _last: float = field(default_factory=time.perf_counter)

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] = now - self._last
        self._last = now


@contextmanager
def limited_threads(wanted: int) -> Iterator[None]:
    """Kernels use at most ``wanted`` threads inside; 0 for all."""
    import numba

    before = numba.get_num_threads()
    if wanted:
        numba.set_num_threads(min(wanted, before))
    try:
        yield
    finally:
        numba.set_num_threads(before)


def check_stations(source: ScanSource) -> None:
    """Raise BimVerifyError when a station has no position."""
    unknown = [s.name for s in source.stations if not s.known]
    if unknown:
        files = ", ".join(Path(p).name for p in source.paths)
        raise BimVerifyError(
            f"{files} names no scanner position ({len(unknown)} of {len(source.stations)} stations), and without one "
            "nothing can be told from what a ray passed; give --origin X,Y,Z in metres, in the scan's own frame "
            "(FILE=X,Y,Z for each of several files)."
        )


def check_one_origin(sources: Sequence[ScanSource], options: InputOptions) -> None:
    """Raise BimVerifyError when one scanner position was given for files of several campaigns."""
    placed = [path for source in sources if isinstance(source, Campaign) for path in source.placed_paths]
    refuse_one_for_several(options.origin, placed)


def check_origins(source: ScanSource) -> None:
    """Raise BimVerifyError when a station cannot have been where its file or ``--origin`` says."""
    given = source.placed if isinstance(source, Campaign) else ()
    impossible = impossible_stations(source, given)
    if not impossible:
        return
    share, files = max(impossible.values()), ", ".join(Path(p).name for p in source.paths)
    if told := [index for index in impossible if index in given]:
        place = ", ".join(f"{value:g}" for value in source.stations[told[0]].position)
        raise BimVerifyError(
            f"The scanner of {files} cannot have stood at {place}, as --origin says: from there {share:.0%} of the returns "
            "would be hidden by others; give its true position, or, of a merged cloud, the scans one by one with their poses."
        )
    names = ", ".join(source.stations[index].name for index in impossible)
    raise BimVerifyError(
        f"{files} says that the scanner of {names} stood at 0, 0, 0, but from "
        f"there {share:.0%} of the returns would be hidden by others: it is a merged cloud, or in "
        "another frame; export the scans one by one with their poses, or give the true position by --origin X,Y,Z."
    )
