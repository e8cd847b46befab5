"""What lies under the mouse: the right element through clouds, the place on it, and lines that say so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from bim_verify.bim_verify_addon import hover, scene
from bim_verify.core.results import VerificationResult

from .stand_in_bonsai import bonsai_holding

ops = bpy.ops.bim_verify
Verification = Callable[[Callable[..., VerificationResult]], None]
OUTSIDE, NORTHWARD = Vector((2.0, -20.0, 1.3)), Vector((0.0, 1.0, 0.0))
"""A ray that meets the south wall, then the north wall."""


def wall(found: bpy.types.Scene, name: str) -> bpy.types.Object:
    return next(o for o in scene.element_objects(found).values() if o.bim_verify.element_name == name)


def test_the_first_visible_element_is_found_at_the_right_place(verified: bpy.types.Scene) -> None:
    south, north = wall(verified, "South"), wall(verified, "North")
    found = hover.element_on_ray(bpy.context, OUTSIDE, NORTHWARD)
    assert found is not None
    assert found[0] == south
    place = south.matrix_world @ south.data.vertices[found[1]].co
    assert np.linalg.norm(np.array(place) - (2.0, 0.0, 1.3)) < 0.5
    south.hide_set(True)
    bpy.context.view_layer.update()
    found = hover.element_on_ray(bpy.context, OUTSIDE, NORTHWARD)
    assert found is not None
    assert found[0] == north
    assert hover.element_on_ray(bpy.context, OUTSIDE, -NORTHWARD) is None


def test_what_a_view_cuts_away_is_looked_through(verified: bpy.types.Scene) -> None:
    space = next(a.spaces.active for s in bpy.data.screens for a in s.areas if a.type == "VIEW_3D")
    space.region_3d.clip_planes = [(0.0, 1.0, 0.0, -1.0)] * 6  # nothing south of y = 1 m
    space.region_3d.use_clip_planes = True
    found = hover.element_on_ray(bpy.context, OUTSIDE, NORTHWARD, space)
    space.region_3d.use_clip_planes = False
    assert found is not None
    assert found[0] == wall(verified, "North")
    found = hover.element_on_ray(bpy.context, OUTSIDE, NORTHWARD, space)
    assert found is not None
    assert found[0] == wall(verified, "South")


def test_what_is_no_element_is_looked_through(verified: bpy.types.Scene) -> None:
    mesh = bpy.data.meshes.new("screen")
    mesh.from_pydata([(-9, -1, -9), (9, -1, -9), (0, -1, 20)], [], [(0, 1, 2)])
    verified.collection.objects.link(bpy.data.objects.new("screen", mesh))
    bpy.context.view_layer.update()
    found = hover.element_on_ray(bpy.context, OUTSIDE, NORTHWARD)
    assert found is not None
    assert found[0] == wall(verified, "South")


def test_the_lines_say_verdict_place_shift_and_reason(verified: bpy.types.Scene, result: VerificationResult) -> None:
    item = next(o for o in scene.element_objects(verified).values() if o.bim_verify.status == "DEVIATING")
    verdict = next(v for v in result.verdicts if v.global_id == item["GlobalId"])
    item.data.attributes["bv_deviation"].data[0].value = 0.0123
    text = "\n".join(hover.lines(item, 0))
    assert item.bim_verify.element_name in text
    assert f"Deviating, {verdict.achieved_loa} of LOA30" in text
    assert "Here: +12.3 mm; " in text
    assert "% occupied" in text
    assert "sigma" in text
    assert verdict.reason.split()[0] in text
    assert "Here" not in "\n".join(hover.lines(item, -1))
    item.data.attributes["bv_deviation"].data[0].value = float("nan")
    assert "nan" not in "\n".join(hover.lines(item, 0))


def test_bonsais_object_stands_for_ours(
    blender: bpy.types.Scene, house: Path, scan: Path, result: VerificationResult, verification: Verification
) -> None:
    verification(lambda *_: result)
    with bonsai_holding(house) as ifc:
        ops.import_scan(filepath=str(scan))
        ops.verify()
        ops.show_results(planned=True)
        theirs = ifc.get_object(next(e for e in ifc.file.by_type("IfcWall") if e.Name == "South"))
        theirs.data.from_pydata([(-9, -1, -9), (9, -1, -9), (0, -1, 20)], [], [(0, 1, 2)])
        bpy.context.view_layer.update()
        assert hover.element_on_ray(bpy.context, OUTSIDE, NORTHWARD) == (wall(blender, "South"), -1)


def test_the_read_out_can_be_turned_off_and_is_forgotten(verified: bpy.types.Scene) -> None:
    assert hover.BIMVERIFY_GGT_hover.poll(bpy.context)
    verified.bim_verify.show_hover = False
    assert not hover.BIMVERIFY_GGT_hover.poll(bpy.context)
    hover.HOVER.lines = ["something"]
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert hover.HOVER.lines == []
