"""What is known in memory beside the .blend file: the model, the last result, the job that runs.

The scene properties name the files, so everything here can be made again; opening another .blend file drops it.
"""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..core.model.elements import BuildingModel
    from ..core.results import AlignmentRecord, VerificationResult

Edit = Callable[["Any"], object]
"""Puts what a step found into an open ``ifcopenshell.file``."""
RESULTS_KEPT = 3
"""Results are large; undo steps farther back ask to verify again."""


@dataclass
class RunningJob:
    """Shown by the panel while a job runs."""

    title: str
    fraction: float = 0.0
    message: str = ""
    seconds_left: float | None = None


@dataclass
class Session:
    """One per Blender process."""

    models: dict[str, BuildingModel] = field(default_factory=dict)
    """Scene name -> model."""
    results: dict[str, VerificationResult] = field(default_factory=dict)
    """``scene.bim_verify.result_key`` -> result, so that undo in Blender brings the earlier one back."""
    edits: dict[str, tuple[str, Edit]] = field(default_factory=dict)
    """``scene.bim_verify.edits[...].key`` -> the operator, and what it has to write into the model."""
    alignments: dict[str, AlignmentRecord] = field(default_factory=dict)
    job: RunningJob | None = None
    ending: threading.Thread | None = None
    """A cancelled job that has not come to its next step yet."""

    def keep(self, result: VerificationResult) -> str:
        """Remember a result and return its key; only the latest few are kept."""
        key = uuid.uuid4().hex
        self.results[key] = result
        while len(self.results) > RESULTS_KEPT:
            del self.results[next(iter(self.results))]
        return key

    def keep_edit(self, name: str, edit: Edit) -> str:
        """The same for what an operator has to write into the model."""
        key = uuid.uuid4().hex
        self.edits[key] = name, edit
        own = [k for k, (of, _) in self.edits.items() if of == name]
        for old in own[:-RESULTS_KEPT]:
            del self.edits[old]
        return key

    def clear(self) -> None:
        """Forget everything (another file was opened, or the extension was disabled)."""
        self.models.clear()
        self.results.clear()
        self.edits.clear()
        self.alignments.clear()
        self.job = None


SESSION = Session()
