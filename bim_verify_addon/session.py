"""What is known in memory beside the .blend file: the model, the last result, the job that runs.

The scene properties name the files, so everything here can be made again; opening another .blend file drops it.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from ..core.change.results import ChangeResult
    from ..core.imagery.coregistration import CoregistrationResult
    from ..core.model.elements import BuildingModel
    from ..core.planning.results import PlanResult
    from ..core.quality.results import QualityResult
    from ..core.results import AlignmentRecord, VerificationResult
    from ..core.wall_displacement.result import DisplacementResult

T = TypeVar("T")
Edit = Callable[["Any"], object]
"""Puts what a step found into an open ``ifcopenshell.file``."""
RESULTS_KEPT = 3
"""Results are large; undo steps farther back ask to verify again."""
COMPARISONS_KEPT = 1
"""Their voxels, and the query positions of a survey, can fill gigabytes."""
EDITS_KEPT = 32
"""Over all scenes; they hold property sets and no evidence."""


@dataclass
class RunningJob:
    """Shown by the panel while a job runs."""

    title: str
    fraction: float = 0.0
    message: str = ""
    seconds_left: float | None = None


def _keep(store: dict[str, T], result: T, most: int) -> str:
    key = uuid.uuid4().hex
    store[key] = result
    while len(store) > most:
        del store[next(iter(store))]
    return key


@dataclass
class Session:
    """One per Blender process."""

    models: dict[str, BuildingModel] = field(default_factory=dict)
    """Scene name -> model."""
    results: dict[str, VerificationResult] = field(default_factory=dict)
    """``scene.bim_verify.result_key`` -> result, so that undo in Blender brings the earlier one back."""
    comparisons: dict[str, ChangeResult] = field(default_factory=dict)
    """``scene.bim_verify_change.result_key`` -> comparison."""
    walls: dict[str, DisplacementResult] = field(default_factory=dict)
    """``scene[wall_scene.RESULT_KEY]`` -> how a wall moved."""
    edits: dict[str, tuple[Edit, ...]] = field(default_factory=dict)
    """``scene.bim_verify.edits[...].key`` -> what an operator has to write into the model."""
    surveys: dict[str, QualityResult] = field(default_factory=dict)
    """``scene[survey_scene.SURVEY_KEY]`` -> scan quality."""
    plans: dict[str, PlanResult] = field(default_factory=dict)
    """``scene[survey_scene.PLAN_KEY]`` -> where to stand."""
    photos: dict[str, CoregistrationResult] = field(default_factory=dict)
    """``scene[photo_scene.RESULT_KEY]`` -> photos placed on the model."""
    alignments: dict[str, AlignmentRecord] = field(default_factory=dict)
    job: RunningJob | None = None
    ending: threading.Thread | None = None
    """A cancelled job that has not come to its next step yet."""

    def keep(self, result: VerificationResult) -> str:
        """Remember a result and return its key; only the latest few are kept."""
        return _keep(self.results, result, RESULTS_KEPT)

    def keep_comparison(self, result: ChangeResult) -> str:
        """The same for a comparison."""
        return _keep(self.comparisons, result, COMPARISONS_KEPT)

    def keep_wall(self, result: DisplacementResult) -> str:
        """The same for a wall's displacement."""
        return _keep(self.walls, result, RESULTS_KEPT)

    def keep_survey(self, result: QualityResult) -> str:
        """The same for what the scans are worth."""
        return _keep(self.surveys, result, COMPARISONS_KEPT)

    def keep_plan(self, result: PlanResult) -> str:
        """The same for a plan."""
        return _keep(self.plans, result, RESULTS_KEPT)

    def keep_photos(self, result: CoregistrationResult) -> str:
        """The same for photos placed on the model."""
        return _keep(self.photos, result, RESULTS_KEPT)

    def keep_edits(self, edits: tuple[Edit, ...]) -> str:
        """The same for what an operator has to write into the model."""
        return _keep(self.edits, edits, EDITS_KEPT)

    def clear(self) -> None:
        """Forget everything (another file was opened, or the extension was disabled)."""
        self.models.clear()
        self.results.clear()
        self.comparisons.clear()
        self.walls.clear()
        self.edits.clear()
        self.surveys.clear()
        self.plans.clear()
        self.photos.clear()
        self.alignments.clear()
        self.job = None


SESSION = Session()
