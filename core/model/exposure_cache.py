"""Which query positions are exposed, kept between runs beside the tessellations: finding out takes many rays."""

from __future__ import annotations

import contextlib
import hashlib
import zipfile

import numpy as np
from numpy.typing import NDArray

from ..files import whole_file
from .elements import BuildingModel
from .tessellation_cache import KEEP_FILES, folder

FORMAT = 2
"""Raised whenever the positions, or what makes one exposed, change."""


def key(model: BuildingModel, spacing: float, most: int) -> str:
    """Name of the cached file for this geometry and these settings."""
    digest = hashlib.sha256(f"{FORMAT}|{spacing!r}|{most}|{len(model.elements)}".encode())
    for array in (model.vertices, model.triangles, model.triangle_element, model.closed):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:40]


def read(cache_key: str, count: int) -> NDArray[np.bool_] | None:
    """(count,) as stored under the key, or None when there is none that can be used."""
    try:
        with np.load(folder() / "exposed" / f"{cache_key}.npz", allow_pickle=False) as stored:
            bits = stored["bits"]
            if bits.dtype != np.uint8 or bits.shape != ((count + 7) // 8,) or int(stored["count"]) != count:
                return None
            return np.unpackbits(bits, count=count).astype(np.bool_)
    except (OSError, EOFError, KeyError, ValueError, TypeError, zipfile.BadZipFile):
        return None


def write(cache_key: str, exposed: NDArray[np.bool_]) -> None:
    """Store the answer; a cache that cannot be written is no error."""
    with contextlib.suppress(Exception):
        place = folder() / "exposed"
        place.mkdir(parents=True, exist_ok=True)
        with whole_file(place / f"{cache_key}.npz") as path:
            np.savez(path, bits=np.packbits(exposed), count=np.int64(len(exposed)))
        for old in sorted(place.glob("*.npz"), key=lambda p: p.stat().st_mtime)[:-KEEP_FILES]:
            old.unlink()
