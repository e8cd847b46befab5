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
    from ..core.model.elements import BuildingModel
    from ..core.results import AlignmentRecord, VerificationResult
    from ..core.wall_displacement.result import DisplacementResult

T = TypeVar("T")
Edit = Callable[["Any"], object]
"""Puts what a step found into an open ``ifcopenshell.file``."""
RESULTS_KEPT = 3
"""Results are large; undo steps farther back ask to verify again."""
COMPARISONS_KEPT = 1
"""Their voxels can fill gigabytes."""
EDITS_KEPT = 16
"""One an operator, over all scenes."""


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
    edits: dict[str, tuple[str, Edit]] = field(default_factory=dict)
    """``scene.bim_verify.edits[...].key`` -> the operator, and what it has to write into the model."""
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

    def keep_edit(self, name: str, edit: Edit) -> str:
        """The same for what an operator has to write into the model; its latest only, since it may hold a comparison."""
        self.edits = {key: kept for key, kept in self.edits.items() if kept[0] != name}
        return _keep(self.edits, (name, edit), EDITS_KEPT)

    def clear(self) -> None:
        """Forget everything (another file was opened, or the extension was disabled)."""
        self.models.clear()
        self.results.clear()
        self.comparisons.clear()
        self.walls.clear()
        self.edits.clear()
        self.alignments.clear()
        self.job = None


SESSION = Session()
