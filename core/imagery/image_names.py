"""Which camera an image file belongs to, by names: with folders or without, with an ending or (labels) without."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

IMAGE_ENDINGS = (".jpg", ".jpeg", ".png", ".tif", ".tiff")


def matching(path: str | Path, names: Sequence[str]) -> list[int]:
    """Rows of the camera ``names`` that mean the image at ``path``: one, none, or several that cannot be told apart.

    The file's name decides, then the name without its ending; among several those whose folders are the path's as well.
    """
    wanted = _parts(str(path))
    for cut in (str, _stem):
        found = [k for k, name in enumerate(names) if cut(_parts(name)[-1]) == cut(wanted[-1])]
        deeper = [k for k in found if _parts(names[k])[:-1] == wanted[-len(_parts(names[k])) : -1]]
        longest = max((len(_parts(names[k])) for k in deeper), default=0)
        best = [k for k in deeper if len(_parts(names[k])) == longest] if len(found) > 1 else found
        if best or found:
            return best or found
    return []


def image_beside(folder: Path, name: str) -> Path | None:
    """The image file in ``folder``, or in the sub-folder that the camera's ``name`` has there, that is meant by the name."""
    below = _parts(name)[:-1]
    for place in (folder.joinpath(*below), folder):
        if ".." in below or not place.is_dir():
            continue
        files = sorted(f for f in place.iterdir() if f.suffix.lower() in IMAGE_ENDINGS and f.is_file())
        exact = [f for f in files if f.name == _parts(name)[-1]]
        meant = exact or [f for f in files if matching(f, [name])]
        if meant:
            return meant[0]
    return None


def _parts(name: str) -> tuple[str, ...]:
    return tuple(part for part in name.replace("\\", "/").split("/") if part) or ("",)


def _stem(name: str) -> str:
    return Path(name).stem
