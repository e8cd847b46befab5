"""A series of images tied to the model: edges are looked for in selected images, and the block is adjusted with them.

An image far along a series has drifted; once a neighbour lies on the model, its pose is good enough to be matched too. So the
images are taken in rounds, those that could be placed first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import BimVerifyError
from ..progress import Progress
from .bundle import BundleResult, Term, adjust_bundle
from .bundle_problem import BundleProblem
from .cameras_file import KnownCamera
from .coregistration import is_placed
from .detect_lines import ImageLines
from .edge_bearers import together
from .free_net import FreeNet
from .line_term import ImageEdges, LineTerm, PosePriors
from .register_image import ImageRegistration, register_image
from .uncertain_lines import LineMatches
from .visible_edges import EdgeViewer

ROUNDS = 3


@dataclass(frozen=True)
class SeriesResult:
    """The adjusted block, and what became of each selected image by its camera's number."""

    bundle: BundleResult
    registrations: Mapping[int, ImageRegistration]


def adjust_series(
    problem: BundleProblem, lines: Mapping[int, ImageLines], viewer: EdgeViewer, origin: np.ndarray, *, model_sigma: float,
    position_sigma: float, rotation_sigma: float, seed: int = 0, robust: bool = True, memory_gb: float = 3.0,
    progress: Progress | None = None,
) -> SeriesResult:
    """Adjust a block whose cameras ``lines`` (by number) show edges of the model in ``viewer``.

    ``origin`` (3,) [m] is the model's local origin in the block's frame; the sigmas [m], [rad] per axis are those of the
    selected images' poses as they are given. Raises BimVerifyError when no selected image can be placed.
    """
    progress = progress or Progress()
    start = problem
    if not len(problem.control.point):
        first = adjust_bundle(
            problem, terms=(FreeNet(problem.cameras),), robust=robust, memory_gb=memory_gb, progress=progress.part(0.0, 0.2)
        )
        start = replace(problem, cameras=first.cameras, points=first.points)
    found: dict[int, ImageRegistration] = {}
    current: BundleResult | None = None
    cameras = start.cameras
    for number in range(ROUNDS):
        waiting = [k for k in lines if k not in found or not is_placed(found[k])]
        if not waiting:
            break
        part = progress.part(0.2 + 0.25 * number, 0.2 + 0.25 * (number + 1))
        for count, k in enumerate(waiting):
            part.update(0.5 * count / len(waiting), f"Edges in {cameras[k].name}")
            sigmas = rotation_sigma, position_sigma
            if current is not None:
                sigmas = _sigmas(current.pose_covariance[k], *sigmas)
            coarse = KnownCamera(replace(cameras[k], position=cameras[k].position - origin), sigmas[1], sigmas[0])
            found[k] = register_image(viewer, lines[k], coarse, model_sigma=model_sigma, seed=seed)
        placed = [k for k in sorted(found) if is_placed(found[k])]
        if not placed:
            break
        at = [replace(found[k].camera, position=found[k].camera.position + origin) for k in placed]
        term = LineTerm([_edges(k, found[k], origin) for k in placed], model_sigma, at)
        terms: list[Term] = [term]
        if not len(problem.control.point):
            terms.append(PosePriors(problem.cameras, list(lines), position_sigma, rotation_sigma))
        current = adjust_bundle(
            replace(start, cameras=cameras), terms=terms, robust=robust, memory_gb=memory_gb, progress=part.part(0.5, 1.0)
        )
        cameras = current.cameras
    if current is None:
        notes = next(iter(found.values())).note if found else "none was given"
        raise BimVerifyError(f"No selected image could be placed on the model: {notes}")
    return SeriesResult(current, found)


def _sigmas(covariance: np.ndarray, most_rotation: float, most_position: float) -> tuple[float, float]:
    """Of rotation [rad] and position [m] per axis, no more than those given, and enough to search in."""
    rotation, position = (float(np.sqrt(np.linalg.eigvalsh(covariance[s, s])[-1])) for s in (slice(0, 3), slice(3, 6)))
    return min(max(rotation, 0.2 * most_rotation), most_rotation), min(max(position, 0.2 * most_position), most_position)


def _edges(camera: int, found: ImageRegistration, origin: np.ndarray) -> ImageEdges:
    kept = [m for m in found.matches if m.kept]
    lens = found.lines
    ends = np.array([m.line for m in kept])
    apart = np.abs(np.column_stack([lens.start, lens.end])[None] - ends[:, None]).sum(axis=2)
    row = np.argmin(apart, axis=1)
    line, cov = lens.uncertain(row, np.array([m.crowding for m in kept]))
    edge = np.array([m.edge for m in kept]) + origin
    nothing = np.zeros((len(kept), 3, 3))
    return ImageEdges(
        camera, LineMatches(line, cov, edge[:, 0], edge[:, 1], nothing, nothing), together([m.bearers for m in kept])
    )
