"""A scan and a model to a scan that knows its elements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..classification.assign import Assigner, Window
from ..classification.results import Classification
from ..errors import BimVerifyError
from ..evidence.registration import FALLBACK_M
from ..model.elements import BuildingModel
from ..options import ClassifyOptions, VerifyOptions
from ..progress import Progress
from ..results import VerificationResult
from ..scans.campaign import ScanSource
from ..scans.open import open_scans
from ..scans.read_ahead import read_ahead
from ..sensing.loa import level_sigma
from .inputs import Stopwatch, limited_threads, open_campaign, open_model
from .verification import verify


def classify(
    model: BuildingModel | str | Path,
    scans: ScanSource | Sequence[str | Path],
    options: ClassifyOptions | None = None,
    progress: Progress | None = None,
) -> Classification:
    """Assign every return to the element whose surface it met. Nothing is written.

    ``model`` and ``scans`` may be files or what was read from them. Raises BimVerifyError with one sentence when a file
    cannot be used, or when no return lies on the model.
    """
    options = options or ClassifyOptions()
    progress = progress or Progress()
    with limited_threads(options.threads):
        watch = Stopwatch()
        model = open_model(model, options, progress.part(0.0, 0.1))
        watch.lap("tessellation")
        opened = open_scans(scans, origin=options.origin) if isinstance(scans, Sequence) else scans
        source = open_campaign(model, opened, options)
        registration, shift, absent = options.registration_sigma, None, np.zeros(len(model.elements), np.bool_)
        if options.as_built:
            found = verify(model, opened, _verify_options(options), progress.part(0.1, 0.6))
            shift, absent = _as_built(found)
            if registration is None:
                registration = max((s.registration_sigma for s in found.stations), default=FALLBACK_M)
            watch.lap("verification")
        registration = FALLBACK_M if registration is None else registration
        window = Window.of(level_sigma(options.loa), options.sigma, registration)
        assigner = Assigner(model, window, shift)
        watch.lap("surfaces")
        element, deviation, station = _assign(
            model, source, assigner, progress.part(0.6 if options.as_built else 0.1, 1.0)
        )
        watch.lap("assignment")
    if not (element >= 0).any():
        raise BimVerifyError(
            f"No return of {', '.join(Path(p).name for p in source.paths)} lies on the model's surface: register the scans "
            "to the model first (bim-verify verify --align auto shows whether they can be)."
        )
    counts, mean, spread = _tally(len(model.elements), len(source.stations), element, deviation, station)
    moved = {
        e.global_id: (float(v[0]), float(v[1]), float(v[2]))
        for e, v in zip(model.elements, shift if shift is not None else (), strict=False)
        if np.isfinite(v).all() and v.any()
    }
    return Classification(
        model, source, element, deviation, counts, mean, spread, window.reach, registration, moved,
        tuple(e.global_id for e, gone in zip(model.elements, absent, strict=True) if gone), watch.seconds,
        source.dropped,
    )


def _verify_options(options: ClassifyOptions) -> VerifyOptions:
    return VerifyOptions(
        loa=options.loa, sigma=options.sigma, registration_sigma=options.registration_sigma,
        scan_frame=options.scan_frame, origin=options.origin, threads=options.threads, memory_gb=options.memory_gb,
        cache=options.cache,
    )


def _as_built(found: VerificationResult) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(E, 3) [m] shifts of the elements that have moved significantly, NaN for absent ones; and (E,) which are absent."""
    shift = np.zeros((len(found.verdicts), 3))
    absent = np.zeros(len(found.verdicts), np.bool_)
    for row, verdict in enumerate(found.verdicts):
        if verdict.status == "ABSENT":
            shift[row], absent[row] = np.nan, True
        elif verdict.significant and verdict.displacement_vector is not None:
            shift[row] = verdict.displacement_vector
    return shift, absent


def _assign(
    model: BuildingModel, source: ScanSource, assigner: Assigner, progress: Progress
) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.int32]]:
    positions = [s.position - model.origin for s in source.stations]
    elements, deviations, stations = [], [], []
    read = 0
    for block in read_ahead(source.blocks):
        assigned = assigner.assign(positions[block.station], block.offsets)
        elements.append(assigned.element)
        deviations.append(assigned.deviation)
        stations.append(np.full(len(block.offsets), block.station, np.int32))
        read += len(block.offsets)
        progress.update(read / max(source.point_count, 1), f"Assigning returns ({read / 1e6:.1f} million)")
    if not elements:
        return np.zeros(0, np.int32), np.zeros(0, np.float32), np.zeros(0, np.int32)
    return np.concatenate(elements), np.concatenate(deviations), np.concatenate(stations)


def _tally(
    elements: int, stations: int, element: NDArray[np.int32], deviation: NDArray[np.float32], station: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    row = np.where(element >= 0, element, elements).astype(np.int64)
    counts = np.bincount(row * stations + station, minlength=(elements + 1) * stations).reshape(elements + 1, stations)
    on = element >= 0
    number = counts[:-1].sum(axis=1)
    value = deviation[on].astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(element[on], weights=value, minlength=elements) / number
        square = np.bincount(element[on], weights=value**2, minlength=elements) / number
    return counts.astype(np.int64), mean, np.sqrt(np.maximum(square - mean**2, 0.0))
