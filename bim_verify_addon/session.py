"""What is known in memory beside the .blend file: the model, the last result, the job that runs.

The scene properties name the files, so everything here can be made again; opening another .blend file drops it.
"""

from __future__ import annotations

import threading
import uuid
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..core.model.elements import BuildingModel
    from ..core.results import AlignmentRecord, VerificationResult

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

    def clear(self) -> None:
        """Forget everything (another file was opened, or the extension was disabled)."""
        self.models.clear()
        self.results.clear()
        self.alignments.clear()
        self.job = None


SESSION = Session()
