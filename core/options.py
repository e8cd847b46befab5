"""Typed options of the jobs, one place for defaults and the reasons for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .scans.origins import Origins

AlignMode = Literal["none", "fine", "auto"]
FusionRule = Literal["station", "dempster", "yager", "dubois-prade"]
ScanFrame = Literal["auto", "model", "map"]


@dataclass(frozen=True, kw_only=True)
class InputOptions:
    """How inputs are read, and what a job may use; the options of every job have these."""

    scan_frame: ScanFrame = "auto"
    """Whether the scans are in the model's own frame or in that of its map conversion."""
    origin: Origins = None
    """Scanner position for a scan file that does not have any, metres, scan frame; for several, one for each by its path or
    name."""
    threads: int = 0
    """0: as many as the machine has."""
    memory_gb: float = 3.0
    cache: bool = True
    """Keep tessellations between runs."""


@dataclass(frozen=True, kw_only=True)
class VerifyOptions(InputOptions):
    """Options of ``jobs.verify``. Lengths in metres."""

    loa: int = 30
    """Required level of accuracy, 10 to 50."""
    sigma: float = 0.0025
    """Standard deviation of one return along its ray at normal incidence, metres (typical terrestrial scanner)."""
    registration_sigma: float | None = None
    """Standard deviation of a station's position against the model, metres; None: estimated from the stations' agreement."""
    align: AlignMode = "none"
    sample_spacing: float = 0.02
    """Distance between query positions, metres."""
    fusion: FusionRule = "station"
    """``station`` is the product's default (shared error discounted); the others are the named methods of the literature."""
    preset: str = "derived"
    """``derived``: kappa, c and lambda from point spacing and sensor sigma; else a named preset of sensing.presets."""
    only: tuple[str, ...] = ()
    """GlobalIds of the elements to verify; empty: all. The verdicts on others are then rough, and not to be used."""
    dense: tuple[str, ...] = ()
    """Files of dense points that were made with the photogrammetric project among the scans."""
    seed: int = 0


MOST_VOXEL_M = 1.0
MOST_MIN_POINTS = 1000


@dataclass(frozen=True, kw_only=True)
class ChangeOptions(InputOptions):
    """Options of ``jobs.change``. Lengths in metres."""

    voxel: float = 0.01
    """Edge of a voxel, metres, at most MOST_VOXEL_M; doubled as often as it takes when the model's solids do not fit into the
    memory."""
    min_points: int = 3
    """Returns that make a voxel occupied, 1 to MOST_MIN_POINTS; fewer do where a surface would send fewer back."""
    loa: int | None = None
    """Level of accuracy that the result is wanted for; a warning says when voxels cannot support it."""
    sigma: float = 0.0025
    """Standard deviation of one return along its ray, metres."""
    registration_sigma: float | None = None
    """Standard deviation of a station's position, metres; None: estimated from the stations' agreement."""
    sample_spacing: float = 0.02
    """Distance between query positions on planned surfaces, metres."""
    align: AlignMode = "none"
    """How each epoch, and the reference, is brought to the model, each for itself."""
    date: str = ""
    """Day of the last epoch, for scans that do not say it (ISO 8601)."""


@dataclass(frozen=True, kw_only=True)
class ReconstructOptions(InputOptions):
    """Options of ``jobs.reconstruct``. Lengths in metres."""

    sigma: float = 0.0025
    """Standard deviation of one return along its ray, metres."""
    registration_sigma: float | None = None
    """Standard deviation of a station's position, metres; None: estimated from the stations' agreement."""


@dataclass(frozen=True, kw_only=True)
class ClassifyOptions(InputOptions):
    """Options of ``jobs.classify``. Lengths in metres."""

    loa: int = 30
    """Level of accuracy of the planned surfaces, 10 to 50."""
    sigma: float = 0.0025
    """Standard deviation of one return along its ray, metres."""
    registration_sigma: float | None = None
    """Standard deviation of a station's position, metres; None: what the verification finds, or a usual one without."""
    as_built: bool = False
    """Verify first, and look for elements that have moved where they were found, and not for absent ones."""
