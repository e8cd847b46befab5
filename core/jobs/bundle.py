"""Bundle adjustment: from a project file to adjusted cameras and tie points with their covariances."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ... import __version__
from ..imagery.bundle import BundleResult, adjust_bundle
from ..imagery.bundle_problem import BundleProblem
from ..imagery.bundle_project import read_project
from ..progress import Progress
from .inputs import Stopwatch, limited_threads


@dataclass(frozen=True)
class AdjustedBundle:
    """A bundle before and after."""

    problem: BundleProblem
    result: BundleResult
    method: str
    timings: dict[str, float] = field(default_factory=dict)


def bundle(
    project: str | Path | BundleProblem, *, robust: bool = True, threads: int = 0, progress: Progress | None = None
) -> AdjustedBundle:
    """Adjust a project; nothing is written.

    ``robust`` takes the weight of gross errors. Raises BimVerifyError with one sentence when the project cannot be read or
    adjusted.
    """
    progress = progress or Progress()
    with limited_threads(threads):
        watch = Stopwatch()
        problem = project if isinstance(project, BundleProblem) else read_project(project)
        watch.lap("reading")
        result = adjust_bundle(problem, robust=robust, progress=progress)
        watch.lap("adjustment")
    return AdjustedBundle(problem, result, f"bim_verify {__version__} bundle", dict(watch.seconds))
