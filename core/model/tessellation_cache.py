"""Tessellations kept between runs, keyed by the content of the IFC file."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import sys
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ..files import whole_file
from .elements import BuildingModel, Element, MapConversion

FORMAT = 4
"""Raised whenever what is stored, or how surfaces are made, changes."""
KEEP_FILES = 64


def folder() -> Path:
    """The user's cache folder, or ``BIM_VERIFY_CACHE`` where that is set."""
    if chosen := os.environ.get("BIM_VERIFY_CACHE"):
        return Path(chosen)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "bim_verify" / "tessellation"


def key(content_hash: str, deflection: float) -> str:
    """Name of the cached file for this content, tolerance, and version of the geometry kernel."""
    import ifcopenshell

    text = f"{FORMAT}|{content_hash}|{deflection!r}|{ifcopenshell.version}"
    return hashlib.sha256(text.encode()).hexdigest()[:40]


def read(cache_key: str, source: Path) -> BuildingModel | None:
    """The model stored under the key, or None when there is none that can be used."""
    path = folder() / f"{cache_key}.npz"
    try:
        with np.load(path, allow_pickle=False) as stored:
            meta = json.loads(bytes(stored["meta"]).decode())
            conversion = meta["map_conversion"]
            return BuildingModel(
                path=str(source),
                content_hash=meta["content_hash"],
                schema=meta["schema"],
                length_unit_m=meta["length_unit_m"],
                origin=stored["origin"],
                elements=tuple(Element(**e) for e in meta["elements"]),
                vertices=stored["vertices"],
                triangles=stored["triangles"],
                triangle_element=stored["triangle_element"],
                closed=stored["closed"],
                transparent=stored["transparent"],
                map_conversion=conversion
                and MapConversion(
                    np.array(conversion["offset"]), conversion["angle"], conversion["scale"], conversion["name"]
                ),
                skipped=tuple(meta["skipped"]),
                project_name=meta["project_name"],
                project_id=meta["project_id"],
                partly=tuple(meta["partly"]),
            )
    except (OSError, EOFError, KeyError, ValueError, TypeError, zipfile.BadZipFile):
        return None


def write(cache_key: str, model: BuildingModel) -> None:
    """Store the model; a cache that cannot be written is no error."""
    conversion = model.map_conversion
    meta = {
        "content_hash": model.content_hash,
        "schema": model.schema,
        "length_unit_m": model.length_unit_m,
        "elements": [asdict(e) for e in model.elements],
        "map_conversion": conversion
        and {
            "offset": conversion.offset.tolist(),
            "angle": conversion.angle,
            "scale": conversion.scale,
            "name": conversion.name,
        },
        "skipped": list(model.skipped),
        "project_name": model.project_name,
        "project_id": model.project_id,
        "partly": list(model.partly),
    }
    with contextlib.suppress(Exception):
        folder().mkdir(parents=True, exist_ok=True)
        packed = io.BytesIO()  # a ZipFile whose disk fills up complains on stderr when it is collected
        np.savez(
            packed,
            meta=np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8),
            origin=model.origin,
            vertices=model.vertices,
            triangles=model.triangles,
            triangle_element=model.triangle_element,
            closed=model.closed,
            transparent=model.transparent,
        )
        with whole_file(folder() / f"{cache_key}.npz") as path:
            path.write_bytes(packed.getbuffer())
        _forget_oldest()


def _forget_oldest() -> None:
    files = sorted(folder().glob("*.npz"), key=lambda p: p.stat().st_mtime)
    for path in files[:-KEEP_FILES]:
        path.unlink()
