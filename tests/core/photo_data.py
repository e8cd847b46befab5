"""A room with a door, a window and furniture as a model, and quick photos of it."""

from __future__ import annotations

import numpy as np

from bim_verify.core.imagery.camera import Camera, Interior
from bim_verify.core.model.elements import BuildingModel
from bim_verify.core.simulation.box_building import box, building_model
from bim_verify.core.simulation.photo import looking

LENS = Interior(640, 480, 470.0, 470.0, 322.0, 237.0, (-0.10, 0.02, 0.0005, -0.0003, 0.0))

ROOM = (
    ("floor", (-0.2, -0.2, -0.2), (5.2, 4.2, 0.0)), ("ceiling", (-0.2, -0.2, 2.6), (5.2, 4.2, 2.8)),
    ("west", (-0.2, -0.2, 0.0), (0.0, 4.2, 2.6)), ("east", (5.0, -0.2, 0.0), (5.2, 4.2, 2.6)),
    ("south", (0.0, -0.2, 0.0), (5.0, 0.0, 2.6)), ("north", (0.0, 4.0, 0.0), (5.0, 4.2, 2.6)),
    ("door", (1.0, 3.9, 0.0), (1.9, 4.0, 2.1)), ("window", (3.0, 3.92, 0.9), (4.3, 4.0, 2.0)),
    ("cupboard", (4.4, 1.0, 0.0), (5.0, 2.0, 1.9)), ("table", (2.0, 2.2, 0.7), (3.4, 3.0, 0.76)),
    ("beam", (0.0, 1.5, 2.35), (5.0, 1.75, 2.6)),
)  # fmt: skip
"""Name, lowest and highest corner [m]; 5 x 4 x 2.6 m inside."""


def room(origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> BuildingModel:
    """The room as a model."""
    return building_model([box(*one) for one in ROOM], origin=origin)


def camera(name: str = "room.png") -> Camera:
    """In the south-west corner, looking to the north-east."""
    return Camera(name, LENS, looking(0.95, -0.06, 0.02), np.array([0.7, 0.5, 1.5]))
