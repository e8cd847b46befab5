"""An adjusted bundle in the scene: its cameras, and its tie points coloured by their standard deviation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..core.report import palette
from . import frame, photo_scene, project, scene
from .colors import Legend, scale_of
from .point_display import show_as_points

if TYPE_CHECKING:
    from ..core.jobs.bundle import AdjustedBundle

BUNDLE = "Bundle"
BUNDLE_KEY = "bim_verify_bundle"
"""On the tie points and on the cameras of a bundle."""
SIGMA = "bv_sigma"
"""Per tie point: standard deviation per axis, metres."""
SUMMARY_KEY = "bim_verify_bundle_found"
"""On the scene: what the last adjustment found, in one sentence."""
STOPS = photo_scene.RESIDUAL_STOPS
WORST_M = 0.01
"""Standard deviation with the last colour."""


def show_bundle(target: bpy.types.Scene, found: AdjustedBundle, images: Sequence[Path | None] = ()) -> str:
    """Cameras (with ``images`` behind, by camera) and tie points; a bundle that was there before is replaced."""
    from ..core.imagery.bundle_report import point_sigma, summary

    scene.remove(*(item for item in target.objects if BUNDLE_KEY in item))
    result, facts = found.result, summary(found.problem, found.result)
    project.adopt_frame(target, None, result.points)
    place = frame.stored(target) or frame.ViewFrame()
    for k, camera in enumerate(result.cameras):
        image = images[k] if k < len(images) else None
        item = photo_scene.camera_object(camera.name, camera, camera.position, place, image)
        covariance = result.pose_covariance[k]
        item["note"] = (
            f"Position to {1000 * math.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1]):.1f} mm, direction to "
            f"{math.degrees(math.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1])):.3f} degrees (one sigma)"
        )
        _keep(target, item)
    sigma = point_sigma(result)
    middle = np.median(result.points, axis=0)
    mesh = bpy.data.meshes.new("Tie points")
    mesh.vertices.add(len(result.points))
    mesh.attributes["position"].data.foreach_set("vector", (result.points - middle).astype(np.float32).ravel())
    scene.set_attribute(mesh, SIGMA, "FLOAT", sigma.astype(np.float32))
    color = np.ones((len(sigma), 4), dtype=np.float32)
    color[:, :3] = palette.to_linear(palette.ramp_color(sigma, 0.0, WORST_M, STOPS))
    scene.set_attribute(mesh, scene.COLOR, "FLOAT_COLOR", color)
    scene.make_active_color(mesh)
    mesh.update()
    points = bpy.data.objects.new("Tie points", mesh)
    show_as_points(points, target.bim_verify.point_size_mm / 1000)
    points[frame.ORIGIN_KEY] = [float(v) for v in middle]
    frame.place(points, place)
    _keep(target, points)
    target[SUMMARY_KEY] = (
        f"{facts['images']} photos and {facts['points']} tie points are adjusted; sigma 0 {facts['sigma0']:.2f}, points to "
        f"{1000 * facts['point_sigma_median']:.1f} mm."
    )
    return str(target[SUMMARY_KEY])


def show(target: bpy.types.Scene, result: object) -> bool:
    """Show an adjusted bundle in an empty scene (``--blend``); False when it is none."""
    from ..core.jobs.bundle import AdjustedBundle

    if not isinstance(result, AdjustedBundle):
        return False
    show_bundle(target, result)
    return True


def legend(target: bpy.types.Scene) -> Legend | None:
    """What the colours of tie points mean, while there are any."""
    if not any(BUNDLE_KEY in item and item.type == "MESH" for item in target.objects):
        return None
    return Legend((), scale_of(0.0, WORST_M, unit="mm", stops=STOPS))


def _keep(target: bpy.types.Scene, item: bpy.types.Object) -> None:
    item[BUNDLE_KEY] = item.name
    scene.collection(target, BUNDLE).objects.link(item)
