"""Planned solids that overlap: what each of them lost is counted for each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bim_verify.core.change.holders import divided
from bim_verify.core.change.solids import voxelise
from bim_verify.core.jobs import change
from bim_verify.core.occupancy.grid import VoxelGrid
from bim_verify.core.options import ChangeOptions
from bim_verify.core.report.remaining import remaining_mesh, remaining_volume
from bim_verify.core.simulation.scene import Prop

from . import verify_data
from .test_change_parts import mesh_volume
from .verify_data import PLAN, REMOVED, built, house, scan

OPTIONS = ChangeOptions(voxel=0.04, sigma=0.0013, sample_spacing=0.1, memory_gb=1.0)
PILLAR = {"pillar": ("IfcColumn", (6.0, 2.5, 0.0), (6.2, 3.5, 3.0))}
"""In the half of the partition that is gone."""
HALF = {"partition": (((6.0, 0.0, 0.0), (6.2, 2.0, 3.0)),)}
HALL = Prop("hall", "box", (6.1, 2.0, 1.5), (14.0, 6.0, 5.0))
HALF_M3, PILLAR_M3 = 1.2, 0.6


def plan_with(monkeypatch: pytest.MonkeyPatch, more: dict[str, Any], first: bool) -> list[str]:
    plan = {**more, **PLAN} if first else {**PLAN, **more}
    monkeypatch.setattr(verify_data, "PLAN", plan)
    return list(plan)


@pytest.mark.parametrize("first", [True, False], ids=["column first", "wall first"])
def test_a_wall_with_a_column_modelled_inside_loses_all_that_is_gone(monkeypatch: pytest.MonkeyPatch, first: bool) -> None:
    names = plan_with(monkeypatch, PILLAR, first)
    result = change(house(), [scan(built({"pillar": REMOVED}, (), HALF), seed=4)], None, OPTIONS)
    wall, pillar = (result.elements[names.index(name)] for name in ("partition", "pillar"))
    row = names.index("partition")
    assert (wall.state, pillar.state) == ("PARTIAL", "DISAPPEARED")
    assert wall.disappeared_volume == pytest.approx(HALF_M3, rel=0.05)
    assert wall.built_volume == pytest.approx(HALF_M3, rel=0.1)  # the rest of it was not seen
    assert pillar.disappeared_volume == pytest.approx(PILLAR_M3, rel=0.05)
    assert mesh_volume(*remaining_mesh(result, row)) == pytest.approx(HALF_M3, rel=0.05)
    assert remaining_volume(result, row) == pytest.approx(HALF_M3, rel=0.05)


@pytest.mark.parametrize("first", [True, False], ids=["column first", "wall first"])
def test_a_column_that_stands_in_a_wall_that_is_gone(monkeypatch: pytest.MonkeyPatch, first: bool) -> None:
    """What the wall and the column share is there."""
    names = plan_with(monkeypatch, PILLAR, first)
    result = change(house(), [scan(built({}, (), HALF), seed=5)], None, OPTIONS)
    wall, pillar = (result.elements[names.index(name)] for name in ("partition", "pillar"))
    assert pillar.state in ("CONFIRMED", "UNKNOWN") and pillar.disappeared_volume == 0.0
    assert wall.disappeared_volume == pytest.approx(HALF_M3 - PILLAR_M3, rel=0.05)


def test_percent_complete_counts_space_that_elements_share_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the partition's 2.4 m3 and a column in it, which are both gone with the half that the column stands in, half is gone:
    counted for both it would be 1.8 of 3.0 m3. Each has half of what they share."""
    names = plan_with(monkeypatch, PILLAR, False)
    model = house()
    solids = voxelise(model, VoxelGrid.for_model(model.origin, 0.05))
    all_of_them = np.ones(len(names), np.bool_)
    voxels = divided(solids.count, solids.element, solids.further, all_of_them) * 0.05**3
    wall, pillar = names.index("partition"), names.index("pillar")
    assert voxels[[wall, pillar]] == pytest.approx([2 * HALF_M3 - PILLAR_M3 / 2, PILLAR_M3 / 2], rel=0.02)
    without = all_of_them.copy()
    without[pillar] = False
    assert divided(solids.count, solids.element, solids.further, without)[wall] == solids.count[wall]
    monkeypatch.setattr(verify_data, "PLAN", {name: verify_data.PLAN[name] for name in ("floor", "partition", "pillar")})
    result = change(house(), [scan(built({"pillar": REMOVED}, (HALL,), HALF), seed=4)], None, OPTIONS)
    partition, column = result.elements[1:]
    assert (partition.state, column.state) == ("PARTIAL", "DISAPPEARED")
    (storey,) = (g for g in result.groups if g.kind == "storey")
    volume = {e.name: e.volume for e in result.elements}
    floor = volume["floor"]
    done = floor + partition.standing_ratio * (2 * HALF_M3 - PILLAR_M3 / 2)
    assert storey.complete == pytest.approx(done / (floor + 2 * HALF_M3), abs=0.005)


def test_each_of_several_elements_holds_the_voxels_that_they_share(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three solids and two sheets, each in one place: all of them have as many voxels as alone."""
    block, sheet = ("IfcColumn", (6.0, 2.5, 0.0), (6.2, 3.5, 3.0)), ("IfcPlate", (8.0, 0.5, 1.0), (8.002, 2.0, 2.0))
    twins = {"a": block, "b": block, "c": block, "d": sheet, "e": sheet}
    names = plan_with(monkeypatch, twins, False)
    model = house()
    found = voxelise(model, VoxelGrid.for_model(model.origin, 0.05))
    count = dict(zip(names, found.count.tolist(), strict=True))
    assert count["a"] == count["b"] == count["c"] == 4 * 20 * 60
    assert count["d"] == count["e"] > 0
    assert count["partition"] == 4 * 80 * 60
    assert found.further.element.max() == names.index("e")
    assert (np.diff(found.further.brick) >= 0).all()
