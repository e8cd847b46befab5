"""Made-up buildings of ``bench_planning.py``: storeys drawn by chance, and a large room with bays."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.planning.targets import Targets
from bim_verify.core.simulation.box_building import Box, box, building_model
from bim_verify.core.simulation.scene import Scene

BAYS, BAY_M, DEPTH_M = 6, 8.0, 18.0


def random_rooms(seed: int) -> BuildingModel:
    """A storey of 12 m x 9 m with partitions, columns and cupboards at random."""
    random = np.random.default_rng(seed)
    boxes = shell(12.0, 9.0, 2.8)
    for k in range(4):
        length, at = random.uniform(2.0, 4.5), random.uniform([1.0, 1.0], [8.0, 5.0])
        size = (length, 0.12) if k % 2 else (0.12, min(length, 8.5 - at[1]))
        boxes.append(box(f"partition {k}", (*at, 0.0), (at[0] + size[0], at[1] + size[1], 2.8)))
    for k in range(4):
        at = random.uniform([0.5, 0.5], [11.0, 8.0])
        boxes.append(box(f"column {k}", (*at, 0.0), (at[0] + 0.35, at[1] + 0.35, 2.8)))
    return building_model(boxes)


def shell(length: float, width: float, height: float) -> list[Box]:
    """Floor, ceiling and four walls around a rectangle."""
    return [
        box("floor", (-0.2, -0.2, -0.2), (length + 0.2, width + 0.2, 0.0)),
        box("ceiling", (-0.2, -0.2, height), (length + 0.2, width + 0.2, height + 0.2)),
        box("south", (0.0, -0.2, 0.0), (length, 0.0, height)), box("north", (0.0, width, 0.0), (length, width + 0.2, height)),
        box("west", (-0.2, -0.2, 0.0), (0.0, width + 0.2, height)),
        box("east", (length, -0.2, 0.0), (length + 0.2, width + 0.2, height)),
    ]


def bays() -> BuildingModel:
    """A large room with bays between screens: what stands in one is out of sight of the others."""
    boxes = shell(BAYS * BAY_M, DEPTH_M, 3.0)
    for k in range(1, BAYS):
        x = BAY_M * k
        boxes.append(box(f"screen {k} south", (x - 0.1, 0.0, 0.0), (x + 0.1, 0.4 * DEPTH_M, 3.0)))
        boxes.append(box(f"screen {k} north", (x - 0.1, 0.6 * DEPTH_M, 0.0), (x + 0.1, DEPTH_M, 3.0)))
    return building_model(boxes)


def inside(model: BuildingModel, targets: Targets) -> Targets:
    """The targets that look into the room."""
    middle = model.bounds.mean(axis=0)
    low, high = model.bounds[0] + 0.19, model.bounds[1] - 0.19
    kept = ((targets.position > low) & (targets.position < high))[:, :2].all(axis=1)
    kept &= np.abs(targets.normal[:, 2]) < 0.5
    toward = np.einsum("ij,ij->i", middle - targets.position, targets.normal) > 0
    screen = np.array(["screen" in e.name for e in model.elements])[targets.element]
    kept &= toward | screen
    return Targets(*(getattr(targets, f.name)[kept] for f in dataclasses.fields(Targets)))


def free(scene: Scene, places: np.ndarray) -> np.ndarray:
    """Places with half a metre around them."""
    out = np.ones(len(places), dtype=np.bool_)
    for turn in np.arange(12) * (math.pi / 6):
        side = np.broadcast_to([math.cos(turn), math.sin(turn), 0.0], places.shape)
        out &= scene.cast(places, side).distance > 0.5
    return out
