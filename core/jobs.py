"""The whole way, file to verdicts: what every face of the project calls."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from . import evidence as _evidence  # noqa: F401
from .errors import BimVerifyError
from .evidence import decide
from .evidence.collect import Queries, StationIndexes, look
from .evidence.decide import Context, Place
from .evidence.fuse_samples import fuse_samples
from .evidence.gather import SensorModel
from .evidence.registration import estimate_registration_sigma
from .evidence.sightings import Sightings
from .evidence.thresholds import Thresholds
from .model.elements import BuildingModel
from .model.load import load_model
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

MOST_PROBE_SAMPLES = 1500
"""Query positions of an element that test each shifted place: shares to a few percent."""


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
        exposed = np.flatnonzero(samples.exposed)
        queries = Queries(
            exposed, samples.position[exposed], samples.normal[exposed], samples.element[exposed],
            np.zeros((1, 3)).repeat(len(exposed), axis=0),
        )
        seen = look(stations, queries, scene, sensor, explain, progress.part(0.4, 0.8))
        lap("gather the evidence")
        registration = estimate_registration_sigma(seen, samples, options.sigma, window)
        context = Context(
            options.loa, options.sigma, registration, window, thresholds, tuple(s.name for s in store.stations)
        )
        evidence = fuse_samples(
            len(samples), seen, options.fusion, ZONE_SIGMAS * level_sigma(options.loa), registration,
            thresholds.conflict_cap, options.sigma, window,
        )
        lap("fuse")
        verdicts = _decide_all(model, samples, seen, evidence, stations, scene, sensor, explain, context,
                               progress.part(0.85, 1.0))
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


def _decide_all(model, samples, seen, evidence, stations, scene, sensor, explain, context, progress):
    count = len(model.elements)
    first = np.searchsorted(samples.element, np.arange(count + 1))
    row = np.searchsorted(seen.sample, first)
    plans: list[Place] = []
    asked: list[tuple[int, np.ndarray]] = []
    for e in range(count):
        part = seen.rows(np.arange(row[e], row[e + 1]))
        local = part.sample.astype(np.int64)
        area = decide.sighting_area(part, samples.area[local])
        plan = decide.assess_place(np.zeros(3), part, local, samples, area, context)
        plans.append(plan)
        for shift in decide.propose(part, local, samples, plan, context):
            asked.append((e, shift))
    others: list[list[Place]] = [[] for _ in range(count)]
    if asked:
        pieces = []
        for e, shift in asked:
            own = np.arange(first[e], first[e + 1])
            pieces.append(own[:: max(len(own) // MOST_PROBE_SAMPLES, 1)])
        sample = np.concatenate(pieces)
        shift_of = np.repeat(np.array([s for _, s in asked]), [len(p) for p in pieces], axis=0)
        queries = Queries(
            np.arange(len(sample)), samples.position[sample] + shift_of, samples.normal[sample], samples.element[sample],
            shift_of,
        )
        probed = look(stations, queries, scene, sensor, explain, progress)
        edge = np.cumsum([0] + [len(p) for p in pieces])
        cut = np.searchsorted(probed.sample, edge)
        for k, (e, shift) in enumerate(asked):
            part = probed.rows(np.arange(cut[k], cut[k + 1]))
            local = sample[part.sample]
            step = (first[e + 1] - first[e]) / len(pieces[k])
            area = decide.sighting_area(part, samples.area[local] * step)
            others[e].append(decide.assess_place(shift, part, local, samples, area, context))
    verdicts = []
    for e in range(count):
        best = decide.choose(plans[e], others[e], context)
        verdicts.append(
            decide.conclude(e, model, samples, slice(int(first[e]), int(first[e + 1])), evidence, plans[e], best, context)
        )
    return verdicts
