"""What is left of partly demolished elements: meshes, volumes, and a table of them."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..change.results import ChangeResult
from ..change.solids import VoxelBox, solid_voxels_of
from ..files import make_folder, remove_file, whole_file
from .csv_out import csv_bytes, guard
from .voxel_skin import among, in_parts, skin

SHAPES = "remaining.csv"
COLUMNS = ("File", "GlobalId", "Class", "Name", "Planned_m3", "Remaining_m3", "Gone_m3")


@dataclass(frozen=True)
class Shape:
    """The planned voxels of an element, and which of them are left: all but those known not to stand now."""

    box: VoxelBox
    planned: NDArray[np.int64]
    """(N,) numbers of voxels in the box, sorted."""
    left: NDArray[np.bool_]
    """(N,)"""

    @classmethod
    def of(cls, result: ChangeResult, row: int) -> Shape:
        """Of one of ``result.remaining``. What is absent is so whether it stood in a reference or not, and whosever it is."""
        surface = result.surfaces.get(row)
        if surface is None or not len(surface):
            planned, box = solid_voxels_of(result.model, result.edge, row)
        else:
            box = VoxelBox.around(surface.min(axis=0), surface.max(axis=0))
            planned = np.sort(box.code(surface))
        gone = np.sort(box.code(box.part(result.voxels.index[result.voxels.absent])))
        left = np.concatenate([np.zeros(0, np.bool_), *(~among(gone, part) for part in in_parts(planned))])
        return cls(box, planned, left)

    @property
    def share(self) -> float:
        """Of the planned voxels, those that are left."""
        return float(self.left.sum()) / max(len(self.left), 1)


def remaining_mesh(result: ChangeResult, row: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """What is left of a partly demolished element: vertices (V, 3) [m, model frame] and quads (Q, 4), outward.

    Its faces are those of voxels; a sheet thinner than a voxel, or an open surface, is as thick as the voxels that it meets.
    """
    return shape_mesh(result, Shape.of(result, row))


def shape_mesh(result: ChangeResult, shape: Shape) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The same of a shape that is known already."""
    return skin(shape.planned[shape.left], shape.box, np.array(result.anchor), result.edge)


def remaining_volume(result: ChangeResult, row: int) -> float:
    """m3 of that: the planned volume by the share of its voxels that is left, since whole voxels fill a thin wall badly."""
    return Shape.of(result, row).share * result.elements[row].volume


def write_remaining(folder: str | Path, result: ChangeResult) -> list[Path]:
    """Write the remaining shape of every partly demolished element as ``GlobalId.obj`` into ``folder``, and a table of them.

    Where a GlobalId is there twice, or differs from another one by case only (one file on some systems), a number is added.
    Files that the table of an earlier run names are removed where this comparison has none for them; all others are left alone.
    """
    target = make_folder(folder)
    earlier = _named_in(target / SHAPES)
    written, lines, taken = [], [], set()
    for row in result.remaining:
        shape, e = Shape.of(result, row), result.elements[row]
        if not shape.left.any():
            continue
        vertices, quads = shape_mesh(result, shape)
        stem = "".join(c for c in e.global_id if c.isalnum() or c in "_$") or str(row)
        while stem.lower() in taken:
            stem = f"{stem}_{row}"
        taken.add(stem.lower())
        path = target / f"{stem}.obj"
        with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as stream:
            stream.write("# what is left of the element, metres, model frame\n")
            np.savetxt(stream, vertices, fmt="v %.4f %.4f %.4f")
            np.savetxt(stream, quads + 1, fmt="f %d %d %d %d")
        written.append(path)
        volumes = (e.volume, shape.share * e.volume, (1.0 - shape.share) * e.volume)
        stated = [f"{v:.5f}" if e.volume else "" for v in volumes]
        lines.append([path.name, e.global_id, e.ifc_class, guard(e.name), *stated])
    with whole_file(target / SHAPES) as temporary:
        temporary.write_bytes(csv_bytes(COLUMNS, lines))
    for name in earlier:
        if Path(name).stem.lower() not in taken:
            remove_file(target / name)
    return written


def _named_in(table: Path) -> set[str]:
    """Names of the OBJ files, beside it, that a table of remaining shapes lists."""
    try:
        with table.open(encoding="utf-8-sig", newline="") as stream:
            names = [row.get("File") or "" for row in csv.DictReader(stream)]
    except (OSError, ValueError, csv.Error):
        return set()
    return {name for name in names if name.endswith(".obj") and Path(name).name == name}
