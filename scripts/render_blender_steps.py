"""The pictures of docs/blender.md of the optional steps: each panel before and after its work, in a real Blender window.

    blender --factory-startup --window-geometry 0 0 1600 1000 --python scripts/render_blender_steps.py -- [--out docs/images]

``--inputs DIR`` keeps the made-up models, scans and photos there and takes those that it holds; ``--only NAME...`` runs
some of the steps. Needs a window that fills the screen (a virtual one will do). Blender ends when the last picture is there.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
from mathutils import Euler

sys.path.insert(0, str(Path(__file__).resolve().parent))

from blender_window import TO_DRAW_S, choose_tab, in_view, open_only, run, scroll_to_top, shoot, tidy, until_idle, view

from bim_verify.bim_verify_addon import paint, scene
from bim_verify.bim_verify_addon.capabilities.update import show
from bim_verify.core.jobs import verify
from bim_verify.core.model.load import load_model, open_ifc
from bim_verify.core.model.write_psets import write_verified_ifc
from bim_verify.core.options import VerifyOptions
from bim_verify.core.simulation.demo import make_demo, make_later_epoch
from bim_verify.core.simulation.tour_files import write_facade_photo, write_house_block, write_house_photos
from bim_verify.core.simulation.wall_example import write_wall_example
from bim_verify.core.update.update import UpdatedFile, update_file

PHOTO_SEED = 1
FROM_SOUTH_WEST = (62.0, -38.0)
"""Degrees: how far the view is raised from straight down, and its turn about the vertical."""
FROM_SOUTH, FROM_NORTH = (82.0, -12.0), (82.0, 168.0)


def change(inputs: Path, out: Path) -> Iterator[float]:
    """Two epochs of the demo house: the later one against the earlier, then the slider on the earlier one alone."""
    yield from house(inputs, scan=inputs / "scan_later.e57")
    settings = bpy.context.scene.bim_verify_change
    settings.voxel_mm = 30
    bpy.ops.bim_verify.add_reference(filepath=str(inputs / "scan.e57"))
    yield from do("change")
    hide_scans()
    frame(buildings())
    item = next(i for i in buildings() if i.bim_verify.element_name == "Balcony railing west")
    bpy.context.view_layer.objects.active = item
    yield from picture("change", out, frame_first=False)
    settings.epoch = 1
    yield from picture("change", out, "blender_change_reference", frame_first=False)


def quality(inputs: Path, out: Path) -> Iterator[float]:
    """What is missing and why, with the stations."""
    yield from house(inputs)
    yield from do("quality")
    hide_scans()
    yield from picture("quality", out)
    yield from do("plan", loa="20", scanner="fast", coverage=0.6)
    yield from picture("quality", out, "blender_plan")


def reconstruct(inputs: Path, out: Path) -> Iterator[float]:
    """A model of the scans alone."""
    yield from do("import_scan", filepath=str(inputs / "scan.e57"))
    yield from do("reconstruct", filepath=str(inputs / "reconstructed.ifc"))
    hide_scans()
    yield from picture("reconstruct", out)


def displacement(inputs: Path, out: Path) -> Iterator[float]:
    """The wall of docs/displacement.md."""
    settings = bpy.context.scene.bim_verify_displacement
    settings.base, settings.later = str(inputs / "base.e57"), str(inputs / "later.e57")
    yield from do("displacement")
    settings.base, settings.later = "base.e57", "later.e57"  # no path of this machine in a picture
    items = [item for item in bpy.context.scene.objects if item.name.startswith("Wall column")]
    frame(items, FROM_NORTH)
    bpy.context.view_layer.objects.active = items[1]
    yield from picture("displacement", out, frame_first=False)


def classify(inputs: Path, out: Path) -> Iterator[float]:
    """Every return to its element; the cloud that was written is shown, in solid shading without its colours."""
    yield from house(inputs)
    yield from do("classify", filepath=str(inputs / "classified.e57"))
    hide_scans()
    bpy.context.scene.bim_verify.display_points = 500_000
    yield from do("import_scan", filepath=str(inputs / "classified.e57"))
    frame(buildings())
    for item in scene.element_objects(bpy.context.scene).values():
        item.hide_set(True)
    yield from picture("classify", out, frame_first=False)


def facade(inputs: Path, out: Path) -> Iterator[float]:
    """Windows and doors of a painted photo."""
    truth = json.loads((inputs / "facade.json").read_text())
    settings = bpy.context.scene.bim_verify_facade
    settings.corners, settings.width = truth["corners"], truth["width_m"]
    yield from do("facade", filepath=str(inputs / "facade.png"))
    items = list(bpy.context.scene.objects)
    frame(items, FROM_SOUTH)
    chosen = next(item for item in items if item.get("kind") == "window")
    bpy.context.view_layer.objects.active = chosen
    chosen.select_set(True)
    yield from picture("facade", out, frame_first=False)


def photos(inputs: Path, out: Path) -> Iterator[float]:
    """Photos placed on the model."""
    yield from do("import_ifc", filepath=str(inputs / "house.ifc"))
    yield from do("coregister", filepath=str(inputs / "cameras.json"))
    with in_view():
        bpy.ops.view3d.view_camera()
        bpy.ops.view3d.view_center_camera()
    yield from picture("photos", out, frame_first=False)


def bundle(inputs: Path, out: Path) -> Iterator[float]:
    """A block of photos adjusted: its cameras, and tie points coloured by their sigma."""
    yield from do("import_ifc", filepath=str(inputs / "house.ifc"))
    yield from do("bundle", filepath=str(inputs / "block" / "block.json"))
    for item in scene.element_objects(bpy.context.scene).values():
        item.hide_set(True)
    yield TO_DRAW_S
    frame([item for item in bpy.context.scene.objects if item.visible_get()])
    yield from picture("photos", out, "blender_bundle", frame_first=False)


def update(inputs: Path, out: Path) -> Iterator[float]:
    """What ``bim-verify update --blend`` shows."""
    file = open_ifc(inputs / "house_verified.ifc")
    show(bpy.context.scene, UpdatedFile(update_file(file), file))
    paint.refresh(bpy.context.scene)
    scene.show_colors_in_views()
    yield TO_DRAW_S
    frame(buildings())
    for item in scene.element_objects(bpy.context.scene).values():
        item.hide_set("bim_verify_update" not in item)
    yield from picture("update", out, frame_first=False)


STEPS = {f.__name__: f for f in (change, quality, reconstruct, displacement, classify, facade, photos, bundle, update)}
PANELS = {"bundle": "photos"}


def house(inputs: Path, scan: Path | None = None) -> Iterator[float]:
    """The demo house with a scan."""
    yield from do("import_ifc", filepath=str(inputs / "house.ifc"))
    settings = bpy.context.scene.bim_verify
    settings.display_points, settings.point_size_mm = 50_000, 50
    settings.spacing_mm, settings.display_vertices = 100, 250_000
    yield from do("import_scan", filepath=str(scan or inputs / "scan.e57"))


def do(operator: str, **values: Any) -> Iterator[float]:
    """Start an operator as its button does, and wait."""
    with in_view():
        getattr(bpy.ops.bim_verify, operator)("INVOKE_DEFAULT", **values)
    yield from until_idle()


def picture(step: str, out: Path, name: str = "", *, frame_first: bool = True) -> Iterator[float]:
    """The view with the panel of one step open."""
    open_only(step)
    if frame_first:
        frame(buildings())
    yield TO_DRAW_S
    scroll_to_top()
    yield TO_DRAW_S
    shoot(out / f"{name or f'blender_{step}'}.png")


def buildings() -> list[bpy.types.Object]:
    """All elements but the terrain."""
    return [i for i in scene.element_objects(bpy.context.scene).values() if i.bim_verify.ifc_class != "IfcGeographicElement"]


def hide_scans() -> None:
    for item in scene.scan_objects(bpy.context.scene):
        item.hide_set(True)


def frame(items: list[bpy.types.Object], angles: tuple[float, float] = FROM_SOUTH_WEST) -> None:
    """Look at these."""
    for item in scene.element_objects(bpy.context.scene).values():
        if item.bim_verify.ifc_class == "IfcGeographicElement":
            item.hide_set(True)
    with in_view():
        bpy.ops.object.select_all(action="DESELECT")
        for item in items:
            item.select_set(item.visible_get())
        bpy.ops.view3d.view_selected()
        bpy.ops.object.select_all(action="DESELECT")
    region = view().spaces.active.region_3d
    region.view_rotation = Euler((math.radians(angles[0]), 0, math.radians(angles[1]))).to_quaternion()
    region.view_distance *= 0.85


def make_inputs(folder: Path) -> None:
    """What is not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "scan.e57").exists():
        make_demo(folder)
    if not (folder / "scan_later.e57").exists():
        make_later_epoch(folder)
    if not (folder / "later.e57").exists():
        write_wall_example(folder)
    if not (folder / "facade.json").exists():
        photo = write_facade_photo(folder)
        (folder / "facade.json").write_text(json.dumps({"corners": photo.corners, "width_m": photo.width}))
    if not (folder / "cameras.json").exists():
        write_house_photos(load_model(folder / "house.ifc"), folder, PHOTO_SEED)
    if not (folder / "block" / "block.json").exists():
        write_house_block(load_model(folder / "house.ifc"), folder / "block", PHOTO_SEED)
    if not (folder / "house_verified.ifc").exists():
        result = verify(folder / "house.ifc", [folder / "scan.e57"], VerifyOptions(sample_spacing=0.1))
        write_verified_ifc(folder / "house.ifc", result, folder / "house_verified.ifc")


def story(inputs: Path, out: Path, names: list[str]) -> Iterator[float]:
    """The steps, each in a scene of its own; yields seconds to wait before the next."""
    make_inputs(inputs)
    for name in names:
        bpy.context.window_manager.windows[0].scene = bpy.data.scenes.new(name)
        tidy()
        yield TO_DRAW_S
        choose_tab()
        yield TO_DRAW_S
        open_only(PANELS.get(name, name))
        yield TO_DRAW_S
        scroll_to_top()
        yield TO_DRAW_S
        shoot(out / f"empty_{name}.png")
        yield from STEPS[name](inputs, out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent.parent / "docs" / "images")
    parser.add_argument("--inputs", type=Path)
    parser.add_argument("--only", nargs="+", choices=list(STEPS), default=list(STEPS))
    arguments = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    arguments.out.mkdir(parents=True, exist_ok=True)

    def steps() -> Iterator[float]:
        with tempfile.TemporaryDirectory(prefix="bim_verify_docs_") as folder:
            yield from story((arguments.inputs or Path(folder)).resolve(), arguments.out.resolve(), arguments.only)

    run(steps())


main()
