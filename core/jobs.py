"""The whole way, file to verdicts: what every face of the project calls."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from . import evidence as _evidence  # noqa: F401
from .errors import BimVerifyError
from .evidence import decide
from .evidence.collect import StationIndexes
from .evidence.decide import Context
from .evidence.verify import Scenery, looks_through_glass, places, with_glass
from .evidence.fuse_samples import fuse_samples
from .evidence.gather import SensorModel
from .evidence.registration import estimate_registration_sigma
from .evidence.thresholds import Thresholds
from .model.elements import BuildingModel
from .model.load import load_model
from .model.on_element import ElementSurfaces
from .model.raycast import RayScene
from .model.sample_surface import sample_surface
from .model.samples import SurfaceSamples
from .options import VerifyOptions
from .progress import Progress
from .results import AlignmentRecord, StationRecord, VerificationResult
from .scans.campaign import ScanSource
from .scans.store import ReturnStore
from .sensing.loa import UPPER_BOUND_M, level_sigma
from .sensing.presets import PRESETS, ZONE_SIGMAS


def verify_source(
    model: BuildingModel, source: ScanSource, options: VerifyOptions, progress: Progress
) -> VerificationResult:
    timings: dict[str, float] = {}
    clock = time.perf_counter()

    def lap(name: str) -> None:
        nonlocal clock
        now = time.perf_counter()
        timings[name] = now - clock
        clock = now

    scene = RayScene(model)
    samples = sample_surface(model, options.sample_spacing, scene=scene)
    lap("sample the model")
    with ReturnStore(source, options.memory_gb, progress.part(0.1, 0.4)) as store:
        lap("read the scans")
        stations = StationIndexes(store, model.origin)
        thresholds = Thresholds()
        bound = UPPER_BOUND_M[options.loa]
        sensor = SensorModel(
            options.sigma, level_sigma(options.loa), None if options.preset == "derived" else PRESETS[options.preset]
        )
        explain = min(bound, thresholds.explain_within) + 2 * options.sigma
        window = max(bound, thresholds.window_floor) + 3 * options.sigma
        scenery = Scenery(model, samples, stations, scene, ElementSurfaces(model), sensor, explain)
        seen = scenery.look(scenery.plan_queries(), progress.part(0.4, 0.8))
        see_through = looks_through_glass(scenery, seen, window)
        seen = with_glass(scenery, seen, samples.triangle[seen.sample], see_through)
        lap("gather the evidence")
        registration = estimate_registration_sigma(seen, samples, options.sigma, window)
        context = Context(
            options.loa, options.sigma, registration, window, see_through, thresholds, tuple(s.name for s in store.stations)
        )
        evidence = fuse_samples(
            len(samples), seen, options.fusion, ZONE_SIGMAS * level_sigma(options.loa), registration,
            thresholds.conflict_cap, options.sigma, window,
        )
        lap("fuse")
        plans, best = places(scenery, seen, context, progress.part(0.85, 1.0))
        first = np.searchsorted(samples.element, np.arange(len(model.elements) + 1))
        verdicts = [
            decide.conclude(e, model, samples, slice(int(first[e]), int(first[e + 1])), evidence, plans[e], best[e], context)
            for e in range(len(model.elements))
        ]
        lap("decide")
        records = tuple(
            StationRecord(
                s.name, tuple(float(v) for v in s.position), store.count(i), stations.spacing[i], registration, s.known,
                acquired=s.acquired, sensor=s.sensor,
            )
            for i, s in enumerate(store.stations)
        )
    return VerificationResult(
        model=model, options=options, verdicts=tuple(verdicts), samples=samples, evidence=evidence, stations=records,
        alignment=AlignmentRecord("none", np.eye(4), None), scan_paths=source.paths, scan_date="", method="x",
        timings=timings,
    )
