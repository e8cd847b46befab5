"""What became of a set of images: results, and their JSON forms."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..report.json_out import to_plain
from .camera import Camera
from .cameras_file import FORMAT, FORMAT_VERSION, camera_to_plain
from .detect_lines import Detector
from .line_pose import pose_difference
from .register_image import AMBIGUOUS, MOST_BY_CHANCE, ImageRegistration

PLACED = ("REFINED", "PARTLY")
State = Literal["REFINED", "PARTLY", "AMBIGUOUS", "FAILED"]
MEANINGS: dict[str, str] = {
    "REFINED": "the lines fix all six parameters of the pose",
    "PARTLY": "the lines leave a direction of the pose as it was; it is named",
    "AMBIGUOUS": "different poses explain the lines; the coarse one is kept",
    "FAILED": "no pose could be determined; the coarse one is kept",
}


@dataclass(frozen=True, kw_only=True)
class CoregisterOptions:
    """Options of ``jobs.coregister``."""

    loa: int = 30
    """Level of accuracy that the model's edges have."""
    detector: Detector = "lsd"
    focal: bool = False
    """Estimate the focal length too."""
    seed: int = 0
    threads: int = 0
    cache: bool = True


@dataclass(frozen=True)
class CoregistrationResult:
    """One registration per image, in the model's local frame."""

    model: BuildingModel
    images: tuple[str, ...]
    registrations: tuple[ImageRegistration, ...]
    options: CoregisterOptions
    method: str
    timings: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def placed(self) -> int:
        """Number of images that have a pose to go on with."""
        return sum(is_placed(found) for found in self.registrations)

    def camera(self, index: int) -> Camera:
        """The camera to go on with, local frame: refined where that is sure, else the coarse one."""
        found = self.registrations[index]
        return found.camera if is_placed(found) else found.coarse.camera


def state_of(found: ImageRegistration) -> State:
    """What became of one image."""
    if found.estimate is None:
        return "FAILED"
    if found.runner_up > AMBIGUOUS or found.chance > MOST_BY_CHANCE:
        return "AMBIGUOUS"
    return "PARTLY" if found.weak else "REFINED"


def is_placed(found: ImageRegistration) -> bool:
    """Whether an image has a pose to go on with; that of another one is refused, and its figures mean nothing."""
    return state_of(found) in PLACED


def sigmas(covariance: NDArray[np.float64]) -> tuple[float, float]:
    """Largest standard deviation of the rotation [rad] and of the position [m] in any direction."""
    return (
        math.sqrt(float(np.linalg.eigvalsh(covariance[:3, :3])[-1])),
        math.sqrt(float(np.linalg.eigvalsh(covariance[3:, 3:])[-1])),
    )


def refined_cameras(result: CoregistrationResult) -> dict[str, Any]:
    """The content of the refined cameras file: a cameras file with what is known of each pose."""
    entries = []
    for index, found in enumerate(result.registrations):
        camera = result.camera(index)
        state = state_of(found)
        entry = camera_to_plain(replace(camera, position=camera.position + result.model.origin))
        rotation, position = found.coarse.rotation_sigma, found.coarse.position_sigma
        covariance = found.covariance if state in PLACED else None
        if covariance is not None:
            rotation, position = sigmas(covariance)
        entry |= {
            "status": state,
            "position_sigma_m": position,
            "rotation_sigma_deg": math.degrees(rotation),
            "covariance": covariance,
            "sigma0": math.sqrt(found.estimate.variance_factor) if found.estimate else None,
            "redundancy": found.estimate.redundancy if found.estimate else None,
            "focal_sigma_px": found.estimate.focal_sigma if found.estimate else None,
            "lines_matched": len(found.matches),
            "lines_used": sum(m.kept for m in found.matches),
            "explained": found.explained,
            "runner_up": found.runner_up,
            "chance": found.chance,
            "undetermined": [w.text for w in found.weak],
            "note": found.note,
        }
        entries.append(entry)
    plain: dict[str, Any] = to_plain({
        "format": FORMAT, "format_version": FORMAT_VERSION, "frame": "model", "method": result.method,
        "covariance_order": ["rotation about the camera's x, y, z [rad]", "position along the model's x, y, z [m]"],
        "model": {"path": result.model.path, "sha256": result.model.content_hash},
        "cameras": entries,
    })
    return plain


def findings(result: CoregistrationResult) -> dict[str, Any]:
    """Everything found, for ``--json``: the refined cameras and every matched line."""
    document = refined_cameras(result)
    document["format"] = "bim_verify.coregistration"
    document["options"] = to_plain(result.options)
    document["timings"] = to_plain(result.timings)
    document["warnings"] = list(result.warnings)
    document["elements"] = [e.global_id for e in result.model.elements]
    for entry, found in zip(document["cameras"], result.registrations, strict=True):
        entry["shift"] = to_plain(pose_difference(found.camera, found.coarse.camera)) if is_placed(found) else None
        entry["lines"] = [
            {
                "element": m.element, "edge": to_plain(m.edge + result.model.origin), "line": to_plain(m.line),
                "weight": m.weight, "residual_px": to_plain(m.residual), "test": to_plain(m.test), "used": m.kept,
            }
            for m in found.matches
        ]
    return document
