"""What the demo's tour needs beside the house: photos of it, a block of photos, a photo of a street front."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..files import make_folder, whole_file
from ..imagery.bundle_project import FORMAT as BUNDLE_FORMAT
from ..imagery.camera import Interior
from ..imagery.cameras_file import FORMAT, camera_to_plain
from ..model.elements import BuildingModel
from ..model.raycast import RayScene
from .demo import demo_campaign
from .facade_photo import paint_facade, street_camera, truth_of
from .facade_plan import facade_plan
from .photo import photograph, view_points
from .photo_block import cameras_around, photograph_block

LENS = Interior(1280, 960, 920.0, 920.0, 643.0, 476.0, (-0.12, 0.03, 0.0006, -0.0004, 0.0))
COARSE_M, COARSE_DEG = 0.15, 1.0
"""Standard deviations of the poses that the cameras file gives, per axis."""
FACADE_SEED, FACADE_PIXELS = 3, 1600


LIVING_ROOM = np.array([[1.5, 1.2, 1.5], [4.5, 1.3, 1.4], [4.8, 3.0, 1.6], [1.6, 3.2, 1.5]])
"""Places in the demo house, metres, model frame."""
RING, POINTS_PER_PHOTO = 8, 60


@dataclass(frozen=True)
class FacadePhoto:
    """A painted photo of a street front, the corners of the front in it, and its true width."""

    path: Path
    corners: str
    """X,Y,X,Y,X,Y,X,Y [pixels]."""
    width: float
    """Metres."""
    openings: int


@dataclass(frozen=True)
class HousePhotos:
    """Photos of the house as it was built, and the cameras file with their coarse poses."""

    images: tuple[Path, ...]
    cameras: Path


@dataclass(frozen=True)
class HouseBlock:
    """A project of photos, not adjusted, and the true places of its points (M, 3) [m], model frame."""

    project: Path
    points: NDArray[np.float64]


def write_house_photos(model: BuildingModel, folder: str | Path, seed: int, count: int = 2) -> HousePhotos:
    """``house_0.png``, ... and ``cameras.json`` in ``folder``: the demo house as built."""
    folder = make_folder(folder)
    random = np.random.default_rng((seed, 41))
    shift = _as_built(model, seed)
    images, entries = [], []
    for number, camera in enumerate(view_points(model, LENS, count, random)):
        image = folder / f"house_{number}.png"
        with whole_file(image) as temporary:
            Image.fromarray(photograph(model, camera, shift=shift, seed=seed + number)).save(temporary, format="PNG")
        turn, move = np.radians(random.normal(0.0, COARSE_DEG, 3)), random.normal(0.0, COARSE_M, 3)
        entry = camera_to_plain(camera.moved(turn, move))
        entry["image"] = image.name
        entry["position"] = (np.array(entry["position"]) + model.origin).tolist()
        entries.append(entry)
        images.append(image)
    cameras = folder / "cameras.json"
    content = {
        "format": FORMAT, "format_version": 1, "frame": "model", "position_sigma_m": COARSE_M,
        "rotation_sigma_deg": COARSE_DEG, "cameras": entries,
    }
    with whole_file(cameras) as temporary:
        temporary.write_text(json.dumps(content, indent=1), encoding="ascii")
    return HousePhotos(tuple(images), cameras)


def write_house_block(model: BuildingModel, folder: str | Path, seed: int) -> HouseBlock:
    """``block.json`` in ``folder``: a project of photos of the demo house's living room as built, with control points."""
    path = make_folder(folder) / "block.json"
    cameras = cameras_around(LIVING_ROOM - model.origin, RING)
    block, true = photograph_block(RayScene(model, _as_built(model, seed)), cameras, POINTS_PER_PHOTO, seed)
    o, control = block.observed, block.control
    content = {
        "format": BUNDLE_FORMAT, "format_version": 1, "sigma_px": float(o.sigma[0]), "free": list(block.free),
        "cameras": [camera_to_plain(replace(c, position=c.position + model.origin)) for c in block.cameras],
        "points": (block.points + model.origin).tolist(),
        "observations": [[int(c), int(p), *xy] for c, p, xy in zip(o.camera, o.point, o.pixel.tolist(), strict=True)],
        "control": [
            {"point": int(p), "coordinates": place, "sigma_m": sigma} for p, place, sigma in zip(
                control.point, (control.coordinates + model.origin).tolist(), control.sigma.tolist(), strict=True
            )
        ],
    }
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content), encoding="ascii")
    return HouseBlock(path, true + model.origin)


def _as_built(model: BuildingModel, seed: int) -> NDArray[np.float64]:
    """(E, 3) where the demo house's elements stand against the plan, metres; what is missing is far away."""
    shift = np.zeros((len(model.elements), 3))
    for row, edit in demo_campaign(model, seed).edits.items():
        shift[row] = edit.vector if edit.kind == "shift" else (0.0, 0.0, -1000.0)
    return shift


def write_facade_photo(folder: str | Path) -> FacadePhoto:
    """``facade.png`` in ``folder``."""
    path = make_folder(folder) / "facade.png"
    plan = facade_plan(FACADE_SEED)
    camera = street_camera(plan, FACADE_PIXELS, np.random.default_rng((FACADE_SEED, 32)))
    with whole_file(path) as temporary:
        Image.fromarray(paint_facade(plan, camera)).save(temporary, format="PNG")
    corners = np.array(truth_of(plan, camera)["corners_px"]).ravel()
    return FacadePhoto(path, ",".join(f"{value:.1f}" for value in corners), plan.width, len(plan.elements))
