"""Facades in the scene: the rectified photo on its wall, and a rectangle for each opening that a person may move."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.errors import BimVerifyError
from . import frame, project, scene
from .materials import plain_material

if TYPE_CHECKING:
    from ..core.facade.mockup import Mockup

FACADES = "Facades"
BOX_KEY = "bim_verify_facade_box"
"""On a rectangle: the number of its facade."""
KINDS = ("window", "door")
KIND_KEY = "kind"
RISE_KEY = "arch_rise_m"
FLAT_ARCH = 0.2
"""Rise of a flat arch over its width."""
INFERRED_KEY = "inferred_at_m"
"""On a rectangle that the pattern gave: where it was put. Moved by hand, it is no longer inferred."""
UNTOUCHED_M = 1e-3
PHOTO_KEY = "bim_verify_facade_photo"
DATA_KEY = "bim_verify_facades"
"""On the scene: what was found, without the pictures, as JSON."""
BEFORE_M = 0.02
"""The rectangles lie so far before the photo, and the photo before the wall."""
COLORS = {"window": (0.2, 0.5, 0.9, 0.5), "door": (0.85, 0.45, 0.15, 0.5)}


def show_mockup(target: bpy.types.Scene, made: Mockup) -> None:
    """The photos and the rectangles; those that were there before are replaced."""
    from ..core.facade.report import facade_to_plain

    clear(target)
    place = frame.stored(target) or frame.ViewFrame()
    for index, facade in enumerate(made.facades):
        start, along = made.base(index)
        _photo(target, place, start, along, facade.picture, facade.scale.width, facade.scale.height, index)
        for box in facade.boxes:
            low, high = np.array([box.x0, box.z0]), np.array([box.x1, box.z1])
            item = _rectangle(target, place, start, along, low, high, 2 * BEFORE_M, f"{box.kind.title()} type {box.type + 1}")
            item[BOX_KEY], item[RISE_KEY], item.show_wire = index, float(box.rise), True
            if box.inferred:
                item[INFERRED_KEY] = [*low, *high]
            set_kind(item, box.kind)
    footprint = None if made.footprint is None else made.footprint.tolist()
    place_on_map = None if made.place is None else asdict(made.place)
    target[DATA_KEY] = json.dumps(
        {"facades": [facade_to_plain(f) for f in made.facades], "footprint": footprint, "map": place_on_map}
    )


def kind_of(item: bpy.types.Object) -> str:
    """``window`` or ``door``."""
    return "door" if item.get(KIND_KEY) == "door" else "window"


def set_kind(item: bpy.types.Object, kind: str) -> None:
    """Let a rectangle stand for a window or a door, in its colour."""
    item[KIND_KEY], item.color = kind, COLORS[kind]
    item.data.materials.clear()
    item.data.materials.append(plain_material(f"Facade {kind}", COLORS[kind]))


def rise_of(item: bpy.types.Object) -> float:
    """Of the arch, metres."""
    rise = item.get(RISE_KEY, 0.0)
    return float(rise) if isinstance(rise, int | float) and rise > 0 else 0.0


def set_arched(item: bpy.types.Object, arched: bool) -> None:
    """Give a rectangle the usual flat arch, if it has none, or a straight top."""
    if arched != (rise_of(item) > 0):
        item[RISE_KEY] = FLAT_ARCH * float(item.dimensions.x) if arched else 0.0


def read_mockup(target: bpy.types.Scene) -> Mockup:
    """The mock-up that the rectangles make now. Raises BimVerifyError when none is left."""
    from ..core.facade.correct import corrected
    from ..core.facade.footprint import MapPlace
    from ..core.facade.mockup import wall_base
    from ..core.facade.records import FacadeBox

    data = json.loads(target[DATA_KEY])
    footprint = None if data["footprint"] is None else np.array(data["footprint"], dtype=np.float64)
    place = frame.stored(target) or frame.ViewFrame()
    boxes: list[list[Any]] = [[] for _ in data["facades"]]
    bases = [wall_base(footprint, k) for k in range(len(boxes))]
    bpy.context.view_layer.update()
    for item in target.objects:
        index = item.get(BOX_KEY)
        if item.type != "MESH" or not isinstance(index, int) or not 0 <= index < len(boxes) or not len(item.data.vertices):
            continue
        local = np.array([v.co for v in item.data.vertices], dtype=np.float64)
        matrix = np.array(item.matrix_world, dtype=np.float64)
        world = place.to_model(local @ matrix[:3, :3].T + matrix[:3, 3])
        start, along = bases[index]
        x, z = (world[:, :2] - start) @ along, world[:, 2]
        low, high = (float(x.min()), float(z.min())), (float(x.max()), float(z.max()))
        guessed = item.get(INFERRED_KEY)
        inferred = guessed is not None and np.allclose(list(guessed), [*low, *high], atol=UNTOUCHED_M)
        boxes[index].append(FacadeBox(*low, *high, kind_of(item), rise_of(item), inferred=inferred))
    return corrected(data["facades"], boxes, footprint, MapPlace(**data["map"]) if data.get("map") else None)


def read_pictures(target: bpy.types.Scene) -> list[NDArray[np.uint8]]:
    """The rectified photos, (H, W, 3) each. Raises BimVerifyError where one was deleted."""
    found = {item[PHOTO_KEY]: item for item in target.objects if PHOTO_KEY in item}
    out = []
    for index in range(len(json.loads(target[DATA_KEY])["facades"])):
        if index not in found:
            raise BimVerifyError(f"The photo of facade {index + 1} was deleted; read it again, or write no report.")
        nodes = found[index].data.materials[0].node_tree.nodes
        image = next(node.image for node in nodes if node.type == "TEX_IMAGE")
        pixels = np.empty(4 * image.size[0] * image.size[1], dtype=np.float32)
        image.pixels.foreach_get(pixels)
        picture = pixels.reshape(image.size[1], image.size[0], 4)[::-1, :, :3]
        out.append(np.ascontiguousarray((255.0 * picture).round().astype(np.uint8)))
    return out


def clear(target: bpy.types.Scene) -> None:
    """Take away what stands for facades."""
    scene.remove(*(item for item in target.objects if BOX_KEY in item or PHOTO_KEY in item))


def show(target: bpy.types.Scene, result: object) -> bool:
    """Show a mock-up in an empty scene (``--blend``); False when it is none."""
    from ..core.facade.mockup import Mockup, mockup_file

    if not isinstance(result, Mockup):
        return False
    model = project.model_of(mockup_file(result))
    project.adopt_frame(target, model)
    scene.show_model(target, model)
    show_mockup(target, result)
    return True


def _rectangle(
    target: bpy.types.Scene, place: frame.ViewFrame, start: NDArray[np.float64], along: NDArray[np.float64],
    low: NDArray[np.float64], high: NDArray[np.float64], before: float, name: str,
) -> bpy.types.Object:
    """A face on the wall whose own zero is its middle, x along the wall."""
    half, middle = 0.5 * (high - low), 0.5 * (low + high)
    mesh = bpy.data.meshes.new(name)
    corners = [(-half[0], 0.0, -half[1]), (half[0], 0.0, -half[1]), (half[0], 0.0, half[1]), (-half[0], 0.0, half[1])]
    mesh.from_pydata([tuple(float(v) for v in c) for c in corners], [], [(0, 1, 2, 3)])
    item = bpy.data.objects.new(name, mesh)
    outward = np.array([along[1], -along[0]])
    spot = np.append(start + middle[0] * along + before * outward, middle[1])
    turn = np.array([[along[0], -along[1], 0.0], [along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    transform = np.eye(4)
    transform[:3, :3] = turn
    # the origin is given before the placement turns it
    item[frame.ORIGIN_KEY] = [float(v) for v in turn.T @ spot]
    item[frame.PLACEMENT_KEY] = [float(v) for v in transform.ravel()]
    frame.place(item, place)
    scene.collection(target, FACADES).objects.link(item)
    return item


def _photo(
    target: bpy.types.Scene, place: frame.ViewFrame, start: NDArray[np.float64], along: NDArray[np.float64],
    picture: NDArray[np.uint8], width: float, height: float, index: int,
) -> None:
    name = f"Facade {index + 1}"
    item = _rectangle(target, place, start, along, np.zeros(2), np.array([width, height]), BEFORE_M, name)
    item[PHOTO_KEY], item.hide_select = index, True
    layer = item.data.uv_layers.new(name="UVMap")
    for corner, uv in zip(layer.data, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        corner.uv = uv
    image = bpy.data.images.new(name, picture.shape[1], picture.shape[0])
    pixels = np.ones((*picture.shape[:2], 4), dtype=np.float32)
    pixels[..., :3] = picture[::-1].astype(np.float32) / 255.0
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    texture, shader = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeEmission")
    texture.image = image
    nodes.active = texture  # what solid shading shows
    links.new(texture.outputs["Color"], shader.inputs["Color"])
    links.new(shader.outputs[0], nodes["Material Output"].inputs["Surface"])
    item.data.materials.append(made)
