"""A comparison as files: voxels as PLY, elements as CSV, everything but the voxels as JSON, remaining shapes as meshes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..change.results import ChangeResult
from ..change.solids import VoxelBox, solid_voxels_of
from ..change.voxels import VoxelCloud
from ..files import whole_file
from ..scans.write_ply import write_ply
from .csv_out import csv_bytes, guard
from .json_out import to_plain
from .palette import VOXEL_COLORS, to_bytes

SHAPES = "remaining.csv"
SHAPE_COLUMNS = ("File", "GlobalId", "Class", "Name", "Planned_m3", "Remaining_m3")
AT_ONCE = 4_000_000
"""Voxels looked at together, so that memory follows the faces and not the voxels inside."""
SIDES = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
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


def remaining_mesh(result: ChangeResult, row: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """What is left of a partly demolished element: vertices (V, 3) [m, model frame] and quads (Q, 4), outward.

    The planned solid in voxels, without those known not to stand now, whether they stood in a reference or not; so its faces
    are those of the voxels.
    """
    left, box, _ = _remaining_voxels(result, row)
    return _skin(left, box, np.array(result.anchor), result.edge)


def remaining_volume(result: ChangeResult, row: int) -> float:
    """m3 of that: the planned volume by the share of its voxels that is left, since whole voxels fill a thin wall badly."""
    return _remaining_voxels(result, row)[2] * result.elements[row].volume


def _remaining_voxels(result: ChangeResult, row: int) -> tuple[NDArray[np.int64], VoxelBox, float]:
    """Sorted numbers of the voxels that are left, their box, and their share of the planned ones."""
    surface = result.surfaces.get(row)
    if surface is None or not len(surface):
        solid, box = solid_voxels_of(result.model, result.edge, row)
    else:
        box = VoxelBox.around(surface.min(axis=0), surface.max(axis=0))
        solid = np.sort(box.code(surface))
    gone = np.sort(box.code(box.part(result.voxels.index[result.voxels.absent])))  # whosever they are
    left = solid[np.concatenate([~_among(gone, part) for part in _parts(solid)] or [np.ones(0, np.bool_)])]
    return left, box, len(left) / max(len(solid), 1)


def write_remaining(folder: str | Path, result: ChangeResult) -> list[Path]:
    """Write the remaining shape of every partly demolished element as ``GlobalId.obj`` into ``folder``, and a table of them.

    The table names the files that are of this comparison; others of an earlier one are left alone.
    """
    from ..files import check_writable

    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    written, lines = [], []
    for row in result.remaining:
        left, box, share = _remaining_voxels(result, row)
        if not len(left):
            continue
        vertices, quads = _skin(left, box, np.array(result.anchor), result.edge)
        safe = "".join(c for c in result.elements[row].global_id if c.isalnum() or c in "_$")
        path = target / f"{safe or row}.obj"
        check_writable(path)
        with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as stream:
            stream.write("# what is left of the element, metres, model frame\n")
            np.savetxt(stream, vertices, fmt="v %.4f %.4f %.4f")
            np.savetxt(stream, quads + 1, fmt="f %d %d %d %d")
        written.append(path)
        e = result.elements[row]
        lines.append([path.name, e.global_id, e.ifc_class, guard(e.name), f"{e.volume:.5f}", f"{share * e.volume:.5f}"])
    with whole_file(target / SHAPES) as temporary:
        temporary.write_bytes(csv_bytes(SHAPE_COLUMNS, lines))
    return written


def _parts(code: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    return np.split(code, range(AT_ONCE, len(code), AT_ONCE)) if len(code) else []


def _among(known: NDArray[np.int64], code: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(N,) is each of ``code`` (N,) among ``known``, which are sorted."""
    if not len(known):
        return np.zeros(len(code), np.bool_)
    return known[np.minimum(np.searchsorted(known, code), len(known) - 1)] == code


def voxel_skin(
    index: NDArray[np.int64], anchor: NDArray[np.float64], edge: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Outer faces of voxels (N, 3): vertices (V, 3) [m, frame of ``anchor``] and quads (Q, 4), outward."""
    if not len(index):
        return np.zeros((0, 3)), np.zeros((0, 4), np.int64)
    box = VoxelBox.around(index.min(axis=0), index.max(axis=0))
    return _skin(np.sort(box.code(index)), box, anchor, edge)


def _skin(
    code: NDArray[np.int64], box: VoxelBox, anchor: NDArray[np.float64], edge: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The same for the numbers of voxels in a box, sorted."""
    corner_box = VoxelBox(box.low, box.size + 1)
    corners = [np.zeros((0, 4), np.int64)]
    for side in SIDES:
        axis = int(np.flatnonzero(side)[0])
        u, v = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        for part in _parts(code):
            open_side = box.index(part[~_among(code, part + box.step(side))])
            base = open_side + np.maximum(side, 0)
            ring = [base, base + u, base + u + v, base + v]
            corners.append(np.stack([corner_box.code(c) for c in (ring if side.sum() > 0 else ring[::-1])], axis=1))
    used, inverse = np.unique(np.concatenate(corners), return_inverse=True)
    return anchor + edge * corner_box.index(used), inverse.reshape(-1, 4)
