"""A reconstruction in a few lines, and as plain values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..dimensions.table import dimensions_to_json as rows_to_json
from .building import ASSUMED, MEASURED, NO_IDS, REVEAL, BuiltStorey, Reconstruction, StoreyIds
from .dimensions import dimension_rows, dimensions_to_json, room_dimensions


def summary_lines(result: Reconstruction) -> list[str]:
    """For a person."""
    openings = [o for s in result.storeys for w in s.walls for o in w.openings]
    kinds = [o.kind for o in openings]
    unclear = sum(o.foot_hidden for o in openings)
    found = ", ".join([
        counted(len(result.storeys), "storey"), *(counted(result.count(f"{what}s"), what) for what in ("room", "wall")),
        counted(kinds.count("door"), "door"), counted(kinds.count("window"), "window"),
        f"{counted(kinds.count('opening') - unclear, 'opening')} without a leaf",
        *([counted(kinds.count("recess"), "recess", "recesses")] if "recess" in kinds else []),
        counted(result.count("columns"), "column"),
    ])  # fmt: skip
    lines = [f"{found} from {result.returns:,} returns of {counted(result.stations, 'station')}."]
    sources = [w.fit.thickness_source for s in result.storeys for w in s.walls]
    lines.append(
        f"Thickness of walls: {sources.count(MEASURED)} measured between both faces, {sources.count(REVEAL)} from reveals, "
        f"{sources.count(ASSUMED)} assumed."
    )
    if result.poses.sigma:
        lines.append(
            f"Poses of stations are taken to be off by {1000 * result.poses.sigma:.1f} mm and "
            f"{math.degrees(result.poses.turn):.4f} degrees (one sigma); every sigma counts it."
        )
    if unclear:
        lines.append(f"Openings whose foot is hidden, so that each may be a door or a window: {unclear}.")
    hidden = sum(len(o.hidden) for o in openings)
    if hidden:
        lines.append(
            f"Edges of openings: {4 * len(openings) - hidden} seen, {hidden} hidden; a hidden one is put in the middle of "
            "where it can be, and its sigma says how far it may be off."
        )
    return lines + [f"Note: {w}" for w in result.warnings]


def counted(number: int, one: str, many: str = "") -> str:
    """The number with its word."""
    return f"{number} {one if number == 1 else many or f'{one}s'}"


def reconstruction_to_json(result: Reconstruction, ids: Sequence[StoreyIds] = ()) -> dict[str, Any]:
    """Metres, scan frame. ``ids``: of what was written (``write_ifc.written_building``)."""
    given = ids or [NO_IDS] * len(result.storeys)
    return {
        "returns": result.returns, "stations": result.stations,
        "registration_sigma": result.poses.sigma, "registration_turn_rad": result.poses.turn, "scans": list(result.scan_paths),
        "seconds": result.timings, "warnings": result.warnings,
        "storeys": [_storey(s, own, result.origin.tolist()) for s, own in zip(result.storeys, given, strict=True)],
        "dimensions": rows_to_json(dimension_rows(result, ids)),
    }


def _storey(s: BuiltStorey, ids: StoreyIds, origin: list[float]) -> dict[str, Any]:
    x, y, z = origin

    def place(p: Any) -> list[float]:
        return [float(p[0]) + x, float(p[1]) + y]

    return {
        "name": s.name, "floor": s.floor + z, "ceiling": s.ceiling + z,
        "rooms": [
            {**_named(ids.rooms, k), "area": r.outline.area, "floor": r.floor + z, "ceiling": r.ceiling + z,
             "height_source": r.height_source, "outline": [place(p) for p in list(r.outline.exterior.coords)[:-1]],
             **dimensions_to_json(room_dimensions(r))}
            for k, r in enumerate(s.rooms)
        ],
        "walls": [
            {**_named(ids.walls, k),
             "start": place(w.start), "end": place(w.end), "thickness": w.thickness, "base": w.base + z, "top": w.top + z,
             "height_source": w.height_source,
             "thickness_source": w.fit.thickness_source, "fit_mean": w.fit.fit_mean, "fit_sigma": w.fit.fit_sigma,
             "position_sigma": w.fit.position_sigma, "quality": w.fit.quality, "external": w.external,
             "lean_rad": w.lean, "lean_sigma_rad": w.lean_sigma, "rooms": list(w.rooms),
             "step": None if w.step is None else {"by": w.step.by, "share": w.step.share},
             "openings": [
                 {**_named(ids.openings[k] if ids.openings else (), n),
                  "kind": o.kind, "from": o.u0, "to": o.u1, "bottom": o.z0 + z, "top": o.z1 + z, "filled": o.filled,
                  "quality": o.quality, "edge_sigma": list(o.edge_sigma), "hidden_edges": list(o.hidden),
                  "foot_hidden": o.foot_hidden, "recess_depth": o.recess}
                 for n, o in enumerate(w.openings)
             ]}
            for k, w in enumerate(s.walls)
        ],
        "slab_openings": [
            {**_named(ids.slab_openings, k), "outline": [place(p) for p in list(h.outline.exterior.coords)[:-1]],
             "area": h.outline.area, "size": h.size, "edge_sigma": h.edge_sigma, "seen": h.seen}
            for k, h in enumerate(s.slab_holes)
        ],
        "columns": [
            {**_named(ids.columns, k), "outline": [place(p) for p in list(c.footprint.exterior.coords)[:-1]],
             "radius": c.radius, "base": c.base + z, "top": c.top + z, "height_source": c.height_source,
             "fit_mean": c.fit.fit_mean, "fit_sigma": c.fit.fit_sigma,
             "position_sigma": c.fit.position_sigma, "quality": c.fit.quality, "thickness_source": c.fit.thickness_source,
             "hidden_faces": list(c.hidden), "on_outline": c.on}
            for k, c in enumerate(s.columns)
        ],
    }  # fmt: skip


def _named(ids: Sequence[str], k: int) -> dict[str, str]:
    return {"global_id": ids[k]} if ids else {}
