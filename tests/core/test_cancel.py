"""A verification that is cancelled stops, wherever it is, and gives no result."""

from __future__ import annotations

from pathlib import Path

import pytest

from bim_verify.core.errors import Cancelled
from bim_verify.core.jobs import dimensions, verify
from bim_verify.core.options import VerifyOptions
from bim_verify.core.progress import Progress

from .room_files import write_room


def messages(folder: Path, stop_at: str | None = None) -> list[str]:
    """What a verification with dimensions says that it does; cancelled as soon as it says ``stop_at``."""
    said: list[str] = []

    def report(_: float, message: str, __: float | None) -> None:
        if message not in said:
            said.append(message)
        if message == stop_at:
            progress.cancel.set()

    progress = Progress(report, interval_s=0.0)
    options = VerifyOptions(sigma=0.001, sample_spacing=0.1, cache=False)
    result = verify(folder / "room.ifc", [folder / "room.e57"], options, progress.part(0.0, 0.8))
    if stop_at is not None and stop_at.startswith("Measuring"):
        dimensions(result, progress=progress.part(0.8, 1.0))
        raise AssertionError(f"dimensions went on after {stop_at!r}")
    assert stop_at is None, f"verify went on after {stop_at!r}"
    dimensions(result, progress=progress.part(0.8, 1.0))
    return said


def test_esc_is_noticed_at_every_step(tmp_path: Path) -> None:
    write_room(tmp_path)
    said = messages(tmp_path)
    assert "Looking again at elements that may have slid" in said
    assert any(m.startswith("Measuring opening") for m in said) and any(m.startswith("Measuring room") for m in said)
    for message in said:
        with pytest.raises(Cancelled):
            messages(tmp_path, message)
