"""What is known in memory beside the .blend file: the model, the last result, the job that runs.

The scene properties name the files, so everything here can be made again; opening another .blend file drops it.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from ..core.change.results import ChangeResult
    from ..core.imagery.coregistration import CoregistrationResult
    from ..core.model.elements import BuildingModel
    from ..core.planning.results import PlanResult
    from ..core.quality.results import QualityResult
    from ..core.results import VerificationResult
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


class Store(dict[str, T]):
    """Results by the key that a scene holds, so that undo in Blender brings an earlier one back; only the latest are kept."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def keep(self, result: T) -> str:
        """Remember a result and return its key."""
        key = uuid.uuid4().hex
        self[key] = result
        while len(self) > self._most:
            del self[next(iter(self))]
        return key


@dataclass
class Session:
    """One per Blender process."""

    models: dict[int, BuildingModel] = field(default_factory=dict)
    """``scene.session_uid`` -> model, whatever the scene is called."""
    results: Store[VerificationResult] = field(default_factory=partial(Store, RESULTS_KEPT))
    """By ``scene.bim_verify.result_key``."""
    comparisons: Store[ChangeResult] = field(default_factory=partial(Store, COMPARISONS_KEPT))
    """By ``scene.bim_verify_change.result_key``."""
    walls: Store[DisplacementResult] = field(default_factory=partial(Store, RESULTS_KEPT))
    """How a wall moved, by ``scene[wall_scene.RESULT_KEY]``."""
    edits: Store[tuple[Edit, ...]] = field(default_factory=partial(Store, EDITS_KEPT))
    """What an operator has to write into the model, by ``scene.bim_verify.edits[...].key``."""
    surveys: Store[QualityResult] = field(default_factory=partial(Store, COMPARISONS_KEPT))
    """Scan quality, by ``scene[survey_scene.SURVEY_KEY]``."""
    plans: Store[PlanResult] = field(default_factory=partial(Store, RESULTS_KEPT))
    """Where to stand, by ``scene[survey_scene.PLAN_KEY]``."""
    photos: Store[CoregistrationResult] = field(default_factory=partial(Store, RESULTS_KEPT))
    """Photos placed on the model, by ``scene[photo_scene.RESULT_KEY]``."""
    job: RunningJob | None = None
    ending: threading.Thread | None = None
    """A cancelled job that has not come to its next step yet."""

    def clear(self) -> None:
        """Forget everything (another file was opened, or the extension was disabled)."""
        for known in vars(self).values():
            if isinstance(known, dict):
                known.clear()
        self.job = None


SESSION = Session()
