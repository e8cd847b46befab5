"""Bundle adjustment: from a project file to adjusted cameras and tie points with their covariances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ..imagery.bundle import BundleResult, adjust_bundle
from ..imagery.bundle_problem import BundleProblem
from ..imagery.bundle_project import read_project
from ..imagery.cameras_file import cameras_of
from ..imagery.coregistration import state_of
from ..imagery.detect_lines import Detector, detect_lines
from ..imagery.determined import determined
from ..imagery.model_edges import sharp_edges
from ..imagery.read_image import read_grey
from ..imagery.series import SeriesResult, adjust_series
from ..imagery.visible_edges import EdgeViewer
from ..model.elements import BuildingModel
from ..model.load import load_model
from ..progress import Progress
from ..sensing.loa import level_sigma
from .inputs import Stopwatch, limited_threads


@dataclass(frozen=True, kw_only=True)
class ModelEdges:
    """Ties selected images of a block to a model."""

    model: BuildingModel | str | Path
    """In the frame of the project."""
    images: Sequence[str | Path]
    """Named as in the project."""
    loa: int = 30
    """Level of accuracy that the model's edges have."""
    position_sigma: float = 0.15
    """Of the images' given poses, metres per axis."""
    rotation_sigma: float = math.radians(1.0)
    detector: Detector = "lsd"
    seed: int = 0


@dataclass(frozen=True)
class AdjustedBundle:
    """A bundle before and after."""

    problem: BundleProblem
    result: BundleResult
    method: str
    left_out: NDArray[np.int64]
    """Rows of the project's points that are not in ``problem``: fewer than two images show them."""
    timings: dict[str, float] = field(default_factory=dict)
    placed: dict[str, str] = field(default_factory=dict)
    """What became of the images that were tied to the model: name and state."""


def bundle(
    project: str | Path | BundleProblem, *, robust: bool = True, threads: int = 0, memory_gb: float = 3.0,
    edges: ModelEdges | None = None, progress: Progress | None = None,
) -> AdjustedBundle:
    """Adjust a project; nothing is written.

    ``robust`` takes the weight of gross errors; ``edges`` adds lines on the model's edges in selected images. Points that
    fewer than two images show are left out. Raises BimVerifyError with one sentence when the project cannot be read or
    adjusted.
    """
    progress = progress or Progress()
    placed: dict[str, str] = {}
    with limited_threads(threads):
        watch = Stopwatch()
        problem, left_out = determined(project if isinstance(project, BundleProblem) else read_project(project))
        watch.lap("reading")
        if edges is None:
            result = adjust_bundle(problem, robust=robust, memory_gb=memory_gb, progress=progress)
        else:
            series = _series(problem, edges, robust, threads, memory_gb, progress)
            result = series.bundle
            placed = {problem.cameras[k].name: state_of(r) for k, r in sorted(series.registrations.items())}
        watch.lap("adjustment")
    return AdjustedBundle(problem, result, f"bim_verify {__version__} bundle", left_out, dict(watch.seconds), placed)


def _series(
    problem: BundleProblem, edges: ModelEdges, robust: bool, threads: int, memory_gb: float, progress: Progress
) -> SeriesResult:
    numbers = cameras_of(edges.images, [c.name for c in problem.cameras])
    model = edges.model
    if not isinstance(model, BuildingModel):
        model = load_model(model, threads=threads, progress=progress.part(0.0, 0.2))
    lines = {}
    for k, path in zip(numbers, edges.images, strict=True):
        lens = problem.cameras[k].interior
        lines[k] = detect_lines(read_grey(path, (lens.width, lens.height)), lens, edges.detector)
    return adjust_series(
        problem, lines, EdgeViewer(model, sharp_edges(model)), np.asarray(model.origin), model_sigma=level_sigma(edges.loa),
        position_sigma=edges.position_sigma, rotation_sigma=edges.rotation_sigma, seed=edges.seed, robust=robust,
        memory_gb=memory_gb, progress=progress.part(0.2, 1.0),
    )
