"""The outline that facades stand on: corners in order, or GeoJSON."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon
from shapely.errors import GEOSException
from shapely.geometry import shape
from shapely.geometry.polygon import orient

from ..errors import BimVerifyError
from ..json_in import read_json

Array = NDArray[np.float64]
LARGEST_FILE = 16 << 20
SHORTEST_M = 0.5
EARTH_M = 6378137.0


def read_footprint(text: str) -> tuple[Array, list[str]]:
    """(N, 2) corners in metres, counter-clockwise seen from above, of a GeoJSON file or of ``X,Y X,Y X,Y ...``, and notes.

    A file with degrees (every coordinate within their range, as GeoJSON has them) is laid flat around its first corner.
    Raises BimVerifyError.
    """
    if Path(text).suffix.lower() in (".geojson", ".json"):
        rows, holes = _of_file(Path(text))
    else:
        holes = 0
        try:
            rows = np.array([[float(v) for v in pair.split(",")] for pair in text.replace(";", " ").split()], dtype=np.float64)
        except ValueError as error:
            raise BimVerifyError(f"--footprint takes corners X,Y X,Y X,Y or a .geojson file, not {text[:60]!r}.") from error
    if rows.ndim != 2 or rows.shape[1:] != (2,) or len(rows) < 3 or not np.isfinite(rows).all():
        raise BimVerifyError("The footprint needs at least three corners of two numbers each.")
    outline = Polygon(rows)
    if not outline.is_valid or outline.area < SHORTEST_M**2:
        raise BimVerifyError("The footprint crosses itself or has no area; give its corners once around it, in order.")
    first = rows[0]
    ring = np.array(orient(outline).exterior.coords)[:-1]
    ring = np.roll(ring, -int(np.argmin(np.linalg.norm(ring - first, axis=1))), axis=0)
    if np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).min() < SHORTEST_M:
        raise BimVerifyError(f"An edge of the footprint is shorter than {SHORTEST_M} m; leave out corners that repeat.")
    notes = [f"Of the footprint {holes} courtyards are left out."] if holes else []
    if not outline.exterior.is_ccw:
        notes.append(
            "The footprint runs clockwise and was turned: the first photo is on the edge between its first and its last corner."
        )
    return np.asarray(ring), notes


def _of_file(path: Path) -> tuple[Array, int]:
    content: Any = read_json(path, "a footprint", LARGEST_FILE)
    try:
        features = content["features"] if content["type"] == "FeatureCollection" else [content]
        shapes: list[Any] = [shape(f["geometry"] if f["type"] == "Feature" else f) for f in features]
        found = [part for s in shapes for part in (s.geoms if s.geom_type == "MultiPolygon" else [s])]
        if len(found) > 1:
            raise BimVerifyError(f"{path} holds {len(found)} outlines; give the one of the building alone.")
        rows = np.array(found[0].exterior.coords, dtype=np.float64)[:-1, :2]
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, GEOSException) as error:
        raise BimVerifyError(f"{path} holds no polygon that can be read; a footprint is a GeoJSON Polygon.") from error
    if len(rows) and np.abs(rows[:, 0]).max() <= 180 and np.abs(rows[:, 1]).max() <= 90 and np.ptp(rows, axis=0).max() < 0.05:
        rows = np.radians(rows - rows[0]) * EARTH_M * [math.cos(math.radians(float(rows[0, 1]))), 1.0]
    return np.asarray(rows), len(found[0].interiors)
