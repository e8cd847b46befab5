"""A wall's displacement in the scene: coloured by direction, an earlier wall replaced, a failure that changes nothing."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from bim_verify.bim_verify_addon import scene as scenery
from bim_verify.bim_verify_addon import wall_scene
from bim_verify.bim_verify_addon.headless import save_blend
from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs import displacement as job
from bim_verify.core.wall_displacement.result import Column, DisplacementField, DisplacementResult, JointDisplacement

ops = bpy.ops.bim_verify
MOVED_M, FAR_M = 0.02, 500_000.0


@pytest.fixture
def found() -> DisplacementResult:
    """Two columns far from zero: one stood still, one came 20 mm out and settled by 10 mm."""
    columns, points, distance, owner = [], [], [], []
    for number, out in enumerate((0.0, MOVED_M)):
        x = FAR_M + 1.5 * number
        joint = JointDisplacement(
            number, "PAIRED", x, (x, 0.0, 1.5), 1.5, -0.5 * out, 0.0005, out, 0.0002, 0.0, 1.0, 1.0, out > 0, out > 0
        )
        new = JointDisplacement(number, "NEW", x, (x, 0.0, 3.0), 3.0)
        nothing = np.zeros(0)
        columns.append(Column(number, x - 0.7, x + 0.7, (joint, new), nothing, nothing, nothing, 1.0, 1.0 - out / MOVED_M))
        for height in (1.0, 1.1, 1.2):
            points.append((x, 0.0, height))
            distance.append(out)
            owner.append(number)
    count = len(points)
    field = DisplacementField(
        np.array(points), np.tile([0.0, 1.0, 0.0], (count, 1)), np.array(distance), np.full(count, 0.002),
        np.full((count, 2), 9, np.int64), np.array(owner, np.int64),
    )
    return DisplacementResult(
        tuple(columns), field, (0.0, 1.0, 0.0), 9.0, (0.01, 0.01), 0.001, ("base.e57",), ("later.e57",), "", "",
        ("A note.",),
    )  # fmt: skip


def color(item: bpy.types.Object) -> np.ndarray:
    values = np.empty(4 * len(item.data.vertices), np.float32)
    item.data.attributes[scenery.COLOR].data.foreach_get("color", values)
    return values.reshape(-1, 4)


def run(blender: bpy.types.Scene, **options: str) -> set[str]:
    blender.bim_verify_displacement.base, blender.bim_verify_displacement.later = "base.e57", "later.e57"
    return ops.displacement(**options)


def test_the_wall_is_shown_where_it_stands_and_coloured(
    blender: bpy.types.Scene, found: DisplacementResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not ops.displacement.poll()
    monkeypatch.setattr(job, "displacement", lambda *_: found)
    assert run(blender) == {"FINISHED"}
    still, moved = sorted(wall_scene.columns(blender), key=lambda item: item[wall_scene.COLUMN_KEY])
    assert "2 columns" in blender[wall_scene.SUMMARY_KEY]
    assert len(moved.data.polygons) == 3
    apart = np.array(moved.matrix_world @ moved.data.vertices[0].co) - np.array(still.matrix_world @ still.data.vertices[0].co)
    assert apart == pytest.approx([1.5, 0.0, 0.0], abs=1e-4)
    normal = np.array(moved.data.polygons[0].normal)
    assert normal == pytest.approx([0.0, 1.0, 0.0], abs=1e-5)
    red, _, blue = color(moved)[0, :3]
    assert red > 2 * blue
    assert color(still)[0, :3].min() > 0.7
    assert "up -10.0 mm" in moved["note"]
    assert "new, not measured" in moved["note"]


def test_the_other_direction_has_colours_of_its_own(
    blender: bpy.types.Scene, found: DisplacementResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(job, "displacement", lambda *_: found)
    run(blender)
    moved = max(wall_scene.columns(blender), key=lambda item: item[wall_scene.COLUMN_KEY])
    out = color(moved).copy()
    blender.bim_verify_displacement.direction = "VERTICAL"
    settled = color(moved)
    assert settled[0, 2] > settled[0, 0]
    assert not np.allclose(out, settled)


def test_a_second_run_replaces_the_wall_and_a_failure_leaves_it(
    blender: bpy.types.Scene, found: DisplacementResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(job, "displacement", lambda *_: found)
    run(blender)
    run(blender)
    assert len(wall_scene.columns(blender)) == 2

    def fail(*_: object) -> DisplacementResult:
        raise BimVerifyError("The scan holds no wall.")

    monkeypatch.setattr(job, "displacement", fail)
    with pytest.raises(RuntimeError, match="no wall"):
        run(blender)
    assert len(wall_scene.columns(blender)) == 2
    with pytest.raises(RuntimeError, match="There is no model"):
        run(blender, element="0000000000000000000000")
    wall_scene.forget(blender)
    assert not wall_scene.columns(blender)
    assert wall_scene.SUMMARY_KEY not in blender


def test_it_can_be_saved_without_a_window(found: DisplacementResult, tmp_path: Path) -> None:
    path = tmp_path / "wall.blend"
    save_blend(found, path)
    with bpy.data.libraries.load(str(path)) as (inside, _):
        assert {"Wall column 0", "Wall column 1"} <= set(inside.objects)


def test_it_is_written_as_a_table_and_a_report(
    blender: bpy.types.Scene, found: DisplacementResult, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert not ops.export_displacement.poll()
    monkeypatch.setattr(job, "displacement", lambda *_: found)
    run(blender)
    path = tmp_path / "moved.csv"
    blender.bim_verify_displacement.with_report = True
    assert ops.export_displacement(filepath=str(path)) == {"FINISHED"}
    assert len(path.read_text().splitlines()) == 1 + 4
    assert "Column" in (tmp_path / "moved_report" / "index.html").read_text()
    assert ops.export_displacement(filepath=str(tmp_path / "alone.csv"), with_report=False) == {"FINISHED"}
    assert not (tmp_path / "alone_report").exists()
    blender.bim_verify_displacement.base = str(path)
    before = path.read_bytes()
    with pytest.raises(RuntimeError, match="is an input"):
        ops.export_displacement(filepath=str(path))
    assert path.read_bytes() == before
    wall_scene.forget(blender)
    assert not ops.export_displacement.poll()


def test_a_point_on_the_wall_is_handed_on(
    blender: bpy.types.Scene, found: DisplacementResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = []
    monkeypatch.setattr(job, "displacement", lambda *values: given.append(values[2].near) or found)
    blender.bim_verify_displacement.near = "1, 2.5, 3"
    run(blender)
    assert given == [(1.0, 2.5, 3.0)]
    with pytest.raises(RuntimeError, match="Near takes three"):
        run(blender, near="1,2")
