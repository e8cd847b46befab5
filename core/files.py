"""Outputs are written whole or not at all: beside their place, then renamed into it."""

from __future__ import annotations

import contextlib
import os
import uuid
from collections.abc import Iterator
from pathlib import Path

from .errors import BimVerifyError


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` (same suffix); rename it into place if the block ends well, else remove it.

    Raises BimVerifyError with one sentence when the place cannot be written (missing folder, permission, disk full).
    """
    target = Path(path)
    temporary = target.with_name(f".{target.stem[:40]}.{uuid.uuid4().hex[:8]}{target.suffix}")
    try:
        check_writable(target)
        yield temporary
        temporary.replace(target)
    except OSError as error:
        raise BimVerifyError(
            f"Cannot write {target}: {error.strerror or error}. Choose another place or free some space."
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def check_writable(path: str | Path) -> None:
    """Raise BimVerifyError now if ``path`` could not be written later: a long job must not find that out at its end."""
    target = Path(path)
    folder = target.parent
    if target.is_dir():
        raise BimVerifyError(f"Cannot write {target}: it is a folder. Give a file name.")
    if not folder.is_dir():
        raise BimVerifyError(f"Cannot write {target}: the folder {folder} does not exist. Create it first.")
    if not os.access(folder, os.W_OK):
        raise BimVerifyError(f"Cannot write {target}: no permission to write in {folder}. Choose another place.")
