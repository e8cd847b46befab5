"""Outputs are written whole or not at all: beside their place, then renamed into it; several can be made one whole."""

from __future__ import annotations

import contextlib
import errno
import os
import uuid
from collections.abc import Iterator
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from .errors import BimVerifyError


@dataclass
class _Together:
    """Files that are whole but not yet in their places, and folders made for them."""

    files: list[tuple[Path, Path]] = field(default_factory=list)
    """Temporary path, target."""
    folders: list[Path] = field(default_factory=list)
    obsolete: list[Path] = field(default_factory=list)
    """Files of an earlier run, to be removed when all are in their places."""

    def commit(self) -> None:
        """Rename all into place; when one cannot be, put back what was there before."""
        done: list[tuple[Path, Path | None]] = []
        target = Path()
        try:
            for temporary, target in self.files:
                if target.is_dir():
                    raise IsADirectoryError(errno.EISDIR, "it is a folder")
                before = _beside(target) if target.exists() else None
                done.append((target, before))
                if before is not None:
                    target.replace(before)
                temporary.replace(target)
        except BaseException as error:
            for place, before in reversed(done):
                with contextlib.suppress(OSError):
                    place.unlink(missing_ok=True) if before is None else before.replace(place)
            if isinstance(error, OSError):
                raise _cannot_write(target, error) from error
            raise
        for old in (*(before for _, before in done if before is not None), *self.obsolete):
            with contextlib.suppress(OSError):
                old.unlink()
        self.folders.clear()

    def clear(self) -> None:
        """Remove what is not in its place."""
        for temporary, _ in self.files:
            with contextlib.suppress(OSError):
                temporary.unlink()
        for folder in reversed(self.folders):
            with contextlib.suppress(OSError):
                folder.rmdir()


_together: ContextVar[_Together | None] = ContextVar("_together", default=None)


@contextlib.contextmanager
def all_or_none() -> Iterator[None]:
    """Every ``whole_file`` finished inside goes into its place when the block ends well, or none does.

    For what is written at the end of a job; nothing written inside can be read by its name before the block ends.
    Raises BimVerifyError when a file cannot be moved into its place; those already moved are taken back.
    """
    if _together.get() is not None:
        yield
        return
    pending = _Together()
    token = _together.set(pending)
    try:
        yield
        pending.commit()
    finally:
        _together.reset(token)
        pending.clear()


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` (same suffix); rename it into place if the block ends well, else remove it.

    Inside ``all_or_none`` the renaming waits for the other files. Raises BimVerifyError with one sentence when the place
    cannot be written (missing folder, permission, disk full).
    """
    target = Path(path)
    temporary = _beside(target)
    pending = _together.get()
    try:
        check_writable(target)
        if pending is not None and any(target.absolute() == other.absolute() for _, other in pending.files):
            raise BimVerifyError(f"{target} is named for two outputs; give each a name of its own.")
        yield temporary
        if pending is None:
            temporary.replace(target)
        else:
            pending.files.append((temporary, target))
            temporary = Path()
    except OSError as error:
        raise _cannot_write(target, error) from error
    finally:
        if temporary.name:
            with contextlib.suppress(OSError):
                temporary.unlink()


def same_file(one: str | Path, other: str | Path) -> bool:
    """Whether two paths name one file, also where the system takes ``SCAN.e57`` for ``scan.e57``."""
    try:
        return Path(one).samefile(other)
    except OSError:
        return Path(one).resolve() == Path(other).resolve()


def remove_file(path: Path) -> None:
    """Remove a file of an earlier run; inside ``all_or_none`` when the outputs are in their places, and only then."""
    pending = _together.get()
    if pending is not None:
        pending.obsolete.append(path)
        return
    with contextlib.suppress(OSError):
        path.unlink()


def make_folder(path: str | Path) -> Path:
    """The folder, made if missing; inside ``all_or_none`` it goes again when the outputs do not get into place."""
    folder = Path(path)
    pending = _together.get()
    try:
        for missing in reversed([p for p in (folder, *folder.parents) if not p.exists()]):
            missing.mkdir(exist_ok=True)
            if pending is not None:
                pending.folders.append(missing)
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise BimVerifyError(
            f"Cannot make the folder {folder}: {error.strerror or error}. Choose another place."
        ) from error
    return folder


def _beside(target: Path) -> Path:
    return target.with_name(f".{target.stem[:40]}.{uuid.uuid4().hex[:8]}{target.suffix}")


def _cannot_write(target: Path, error: OSError) -> BimVerifyError:
    return BimVerifyError(f"Cannot write {target}: {error.strerror or error}. Choose another place or free some space.")


def check_writable(path: str | Path) -> None:
    """Raise BimVerifyError now if ``path`` could not be written later: a long job must not find that out at its end."""
    target = Path(path)
    folder = target.parent
    if target.is_dir():
        raise BimVerifyError(f"Cannot write {target}: it is a folder. Give a file name.")
    if not folder.is_dir():
        raise BimVerifyError(f"Cannot write {target}: the folder {folder} does not exist. Create it first.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise BimVerifyError(f"Cannot write {target}: no permission to write in {folder}. Choose another place.")
