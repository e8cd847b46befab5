"""A comparison as files: voxels as PLY, elements as CSV, everything but the voxels as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..change.results import ChangeResult
from ..change.voxels import VoxelCloud
from ..scans.write_ply import write_ply
from .csv_out import csv_bytes, guard
from .json_out import to_plain
from .palette import VOXEL_COLORS, to_bytes

COLUMNS = (
    "GlobalId", "Class", "Name", "Storey", "State", "ExpectedState", "Agrees", "Progress", "ConfirmedRatio",
    "DisappearedRatio", "NewRatio", "UnknownRatio", "Volume_m3", "DisappearedVolume_m3", "BuiltVolume_m3", "Shift_mm",
    "Task", "Reason",
)  # fmt: skip


def change_to_json(result: ChangeResult) -> dict[str, Any]:
    """Plain lists, dicts, numbers, texts and None. Metres and cubic metres, model frame; docs/change.md describes it."""
    document = {
        "format": "bim_verify.change",
        "format_version": 1,
        "method": result.method,
        "summary": result.summary(),
        "model": {"path": result.model.path, "sha256": result.model.content_hash},
        "voxel_size": result.edge,
        "voxel_anchor": result.anchor,
        "options": result.options,
        "elements": [e.global_id for e in result.elements],
        "changes": result.elements,
        "planned": [
            {"act": p.act, "start": str(p.start or ""), "finish": str(p.finish or ""), "task": p.task, "source": p.source}
            for p in result.planned
        ],
        "epochs": result.epochs,
        "reference": result.reference,
        "offset_from_reference": result.offset_from_reference,
        "voxel_counts": result.voxel_counts,
        "clusters": result.clusters,
        "progress": result.groups,
        "timings": result.timings,
        "warnings": result.warnings,
    }
    plain: dict[str, Any] = to_plain(document)
    return plain


def changes_csv(result: ChangeResult) -> bytes:
    """One line per element, UTF-8 with a byte order mark."""
    return csv_bytes(COLUMNS, (
        [
            *(guard(v) for v in (e.global_id, e.ifc_class, e.name, e.storey)), e.state, e.expected,
            "" if e.agrees is None else str(e.agrees).upper(), e.progress,
            *(f"{v:.4f}" for v in (e.confirmed_ratio, e.disappeared_ratio, e.new_ratio, e.unknown_ratio)),
            *(f"{v:.5f}" for v in (e.volume, e.disappeared_volume, e.built_volume)),
            "" if e.shift is None else f"{1000 * e.shift:.1f}", guard(plan.task), guard(e.reason),
        ]
        for e, plan in zip(result.elements, result.planned, strict=True)
    ))  # fmt: skip


def write_voxels(path: str | Path, result: ChangeResult) -> None:
    """Write the voxels' middles (model frame, metres), normals of their surface, state and element.

    State 0 unknown, 1 confirmed, 2 new, 3 disappeared; ``element`` is the row of ``elements`` in the JSON file, -1 for
    none. The normal points from a voxel's neighbours of the same state towards free space; zero where it has none on any side.
    """
    cloud = result.voxels
    position = np.array(result.anchor) + result.edge * (cloud.index + 0.5)
    normal = voxel_normals(cloud)
    color = to_bytes(VOXEL_COLORS[cloud.state])
    fields: dict[str, NDArray[Any]] = {name: position[:, axis] for axis, name in enumerate(("x", "y", "z"))}
    fields |= {name: normal[:, axis] for axis, name in enumerate(("nx", "ny", "nz"))}
    fields |= {name: color[:, axis] for axis, name in enumerate(("red", "green", "blue"))}
    fields |= {"state": cloud.state, "element": cloud.element}
    write_ply(path, fields, [
        "metres, model frame", f"voxels of {1000 * result.edge:g} mm",
        "state: 0 unknown, 1 confirmed, 2 new, 3 disappeared", "element: row of the elements in the JSON file",
    ])


def voxel_normals(cloud: VoxelCloud) -> NDArray[np.float64]:
    """(N, 3) unit vectors away from the neighbours (26) that are in the cloud; zero where these balance."""
    from ..change.clusters import Neighbours

    inward = Neighbours(cloud.index).pull()
    length = np.linalg.norm(inward, axis=1, keepdims=True)
    return np.where(length > 1e-9, -inward / np.maximum(length, 1e-9), 0.0)
