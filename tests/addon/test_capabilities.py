"""What a capability brings is all there: step, colour modes with their legend, property groups, numbers."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from bim_verify.bim_verify_addon import overlay, panels, scene
from bim_verify.bim_verify_addon.capabilities import CAPABILITIES, MODES
from bim_verify.bim_verify_addon.colors import Category, Surface, categorical, ramp
from bim_verify.core.report import palette
from bim_verify.core.results import VerificationResult

ops = bpy.ops.bim_verify


def test_names_and_colour_modes_are_unique() -> None:
    assert len({c.name for c in CAPABILITIES}) == len(CAPABILITIES)
    assert len(MODES) == sum(len(c.modes) for c in CAPABILITIES)
    steps = [c.step for c in CAPABILITIES if c.step is not None]
    assert len({s.name for s in steps}) == len(steps)
    numbered = [p.bl_label for p in panels.CLASSES if p.bl_idname.startswith("BIMVERIFY_PT_step_")]
    assert numbered == [f"{n}  {step.label}" for n, step in enumerate(steps, start=1)]


def test_property_groups_are_attached(blender: bpy.types.Scene) -> None:
    for capability in CAPABILITIES:
        assert (capability.settings is None) != hasattr(blender, f"bim_verify_{capability.name}")
        assert (capability.element is None) != hasattr(bpy.types.Object, f"bim_verify_{capability.name}")


def test_every_step_says_what_is_missing_or_reached(verified: bpy.types.Scene) -> None:
    empty = bpy.data.scenes.new("empty")
    for capability in CAPABILITIES:
        if capability.step is not None:
            assert not capability.step.state(empty).done
            assert capability.step.state(empty).text
            assert capability.step.state(verified).text


def test_classes_of_another_step_are_no_verdicts(blender: bpy.types.Scene) -> None:
    entry = blender.bim_verify.counts.add()
    entry.mode, entry.category, entry.count = "CHANGE", "NEW", 3
    step = next(c.step for c in CAPABILITIES if c.name == "verify")
    assert step is not None and not step.state(blender).done
    assert not ops.decide.poll()
    entry.mode = "STATUS"
    assert step.state(blender).done


@pytest.mark.parametrize("identifier", list(MODES))
def test_every_mode_colours_and_explains(verified: bpy.types.Scene, identifier: str) -> None:
    mode = MODES[identifier]
    verified.bim_verify.color_mode = identifier
    legend = overlay.legend(verified)
    assert legend.swatches or legend.ramp
    if mode.category is not None:
        counts = {c.category: c.count for c in verified.bim_verify.counts if c.mode == identifier}
        assert not counts or list(counts) == [c.identifier for c in mode.categories]
    for item in scene.element_objects(verified).values():
        if mode.known(item):
            srgb = np.atleast_2d(mode.color(Surface(item), verified))
            assert ((srgb >= 0) & (srgb <= 1)).all()


def test_a_categorical_mode_colours_by_class_and_the_rest_grey(blender: bpy.types.Scene) -> None:
    red, blue = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    mode = categorical("X", "X", "x", (Category("A", "a", "is a", red), Category("B", "b", "is b", blue)), lambda o: o["k"])
    item = bpy.data.objects.new("x", bpy.data.meshes.new("x"))
    for kind, color in (("A", red), ("B", blue), ("", palette.UNMEASURED)):
        item["k"] = kind
        assert tuple(mode.color(Surface(item), blender)) == color
        assert mode.known(item) == bool(kind)
    assert mode.legend(blender).swatches == (("a", red), ("b", blue))


def test_a_ramp_has_units_clips_and_shows_what_is_not_known(blender: bpy.types.Scene) -> None:
    mesh = bpy.data.meshes.new("x")
    mesh.vertices.add(4)
    scene.set_attribute(mesh, "v", "FLOAT", np.array([-1.0, 0.0, 0.05, np.nan]))
    mode = ramp("X", "X", "x", "v", unit="mm", span=lambda _: (0.0, 0.01), stops=("#000000", "#ffffff"), nothing="none")
    color = mode.color(Surface(bpy.data.objects.new("x", mesh)), blender)
    assert color == pytest.approx(np.array([(0, 0, 0), (0, 0, 0), (1, 1, 1), palette.UNMEASURED]))
    legend = mode.legend(blender)
    assert legend.ramp is not None
    assert [text for _, text in legend.ramp.ticks] == ["0 mm", "2.5 mm", "5 mm", "7.5 mm", "10 mm"]
    assert legend.swatches == (("none", palette.UNMEASURED),)


def test_the_active_element_has_its_numbers(verified: bpy.types.Scene, result: VerificationResult) -> None:
    capability = next(c for c in CAPABILITIES if c.name == "verify")
    assert capability.numbers is not None
    assert capability.why is not None
    for verdict in result.verdicts:
        item = scene.element_objects(verified)[verdict.global_id]
        rows = dict(capability.numbers(item))
        assert rows["Verdict"] == palette.STATUS_LABELS[verdict.status]
        assert rows["Level"] == f"{verdict.achieved_loa} of {verdict.required_loa}"
        assert capability.why(item) == verdict.reason
