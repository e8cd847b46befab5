"""What changed: the whole way from epochs of scans to states of voxels, elements and clusters, and the progress."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import date
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ..alignment.align import align
from ..alignment.transform import TransformedSource
from ..change.amounts import Absent, Amount, amounts
from ..change.closing import close_gone
from ..change.clusters import find_clusters
from ..change.common_shift import common_shift
from ..change.decide import element_state, ratios, undecided
from ..change.holders import divided
from ..change.look import LOA, EpochSight, change_tolerance, look_at_elements, sensor_model
from ..change.misplaced import found_ratio, misplaced, place_open, strange
from ..change.planned import Planned, parse_date, read_planned, reversed_tasks
from ..change.progress import expected_state, group_progress, judge, standing_ratio
from ..change.results import ChangeResult, CommonShift, ElementChange, EpochRecord, VoxelCounts
from ..change.solids import SolidVoxels, fitting_edge, voxelise
from ..change.voxels import Universe, compare, count_states, held_voxels, universe, voxel_cloud
from ..errors import BimVerifyError
from ..evidence.collect import StationIndexes
from ..evidence.photo_campaign import adjusted_freely, place_sigma
from ..model.elements import BuildingModel
from ..model.load import open_ifc
from ..model.parts import Parts, read_parts
from ..model.raycast import RayScene
from ..model.sample_surface import sample_surface
from ..model.samples import SurfaceSamples
from ..occupancy.epoch import UNSEEN, Observation, observe, occupied_voxels
from ..occupancy.grid import VoxelGrid
from ..occupancy.votes import Occupied
from ..options import ChangeOptions
from ..progress import Progress
from ..results import AlignmentRecord
from ..scans.campaign import ScanSource
from ..scans.store import ReturnStore
from ..sensing.loa import label, supported_level, worst_voxel_shift
from .inputs import Stopwatch, check_one_origin, limited_threads, open_model, open_with_blocks, opened

Scans = ScanSource | Sequence[str | Path]
MODEL = "model"
BESIDE_M = 5.0
"""What is new is looked for in the box around the model, this much larger on all sides."""
OPEN_WEIGHT_M3 = 1e-3
"""What an element whose surface is open, and which so has no volume, weighs in percent complete."""


def change(
    model: BuildingModel | str | Path,
    epochs: Sequence[Scans],
    reference: Scans | None = None,
    options: ChangeOptions | None = None,
    progress: Progress | None = None,
) -> ChangeResult:
    """Compare epochs of scans with each other and with a model; elements are reported for the last epoch.

    epochs : one or more campaigns in order of time, each scan files or what was opened from them.
    reference : the epoch that the last one is compared with; None: the model.

    Nothing is written. Raises BimVerifyError with one sentence when a file cannot be used or an epoch does not come near
    the model.
    """
    options = options or ChangeOptions()
    progress = progress or Progress()
    if not epochs:
        raise BimVerifyError("No epoch was given. Name the scans of at least one.")
    with limited_threads(options.threads), ExitStack() as stack:
        watch = Stopwatch()
        model = open_model(model, options, progress.part(0.0, 0.08))
        watch.lap("tessellation")
        edge = fitting_edge(model, options.voxel, options.memory_gb)
        grid = VoxelGrid.for_model(model.origin, edge)
        solids = voxelise(model, grid, progress.part(0.08, 0.15))
        watch.lap("solids")
        samples = sample_surface(model, options.sample_spacing, scene=(scene := RayScene(model)), cache=options.cache)
        plans, parts, wrong_tasks = _stated(model)
        watch.lap("query positions")
        campaigns = [*([reference] if reference is not None else []), *epochs]
        sources = [opened(scans, options) for scans in campaigns]
        check_one_origin(sources, options)
        names = [*(["reference"] if reference is not None else []), *_names(len(epochs))]
        views = []
        for n, (name, scans) in enumerate(zip(names, sources, strict=True)):
            part = progress.part(0.15 + 0.6 * n / len(campaigns), 0.15 + 0.6 * (n + 1) / len(campaigns))
            source, blocks = open_with_blocks(model, scans, options)
            record = _aligned(model, samples, source, options, name, part.part(0.0, 0.15))
            if options.align != "none":
                source = TransformedSource(source, record.transform)
            place = place_sigma(blocks) if options.align == "none" else 0.0
            store = stack.enter_context(
                ReturnStore(source, options.memory_gb * 0.5 / len(campaigns), part.part(0.15, 0.3))
            )
            if not any(store.count(s) for s in range(len(store.stations))):
                raise BimVerifyError(
                    f"The scans of the {name} ({', '.join(Path(p).name for p in source.paths)}) hold no return; leave them "
                    "out, or export them again."
                )
            stations = StationIndexes(store, model.origin)
            sight = look_at_elements(
                model, samples, scene, stations, sigma=options.sigma, edge=edge,
                registration_sigma=options.registration_sigma, progress=part.part(0.3, 0.9), parts=parts,
                place=place, aligned_sigma=record.axis_sigma,
            )
            occupied = occupied_voxels(
                stations, grid, options.min_points, sensor_model(options.sigma), part.part(0.9, 1.0),
                model.bounds + np.array([[-BESIDE_M], [BESIDE_M]]),
            )
            views.append(_View(name, source, store, stations, sight, occupied, place, record))
        watch.lap("looking at elements")
        world = universe(solids, [v.occupied for v in views])
        seen = [
            observe(
                v.stations, grid, v.occupied, world.table, world.wanted, sensor_model(options.sigma),
                progress.part(0.75 + 0.15 * n / len(views), 0.75 + 0.15 * (n + 1) / len(views)),
            )
            for n, v in enumerate(views)
        ]
        watch.lap("free space")
        progress.update(0.92, "Comparing")
        result = _compare(model, solids, world, views, seen, reference is not None, plans, options, watch)
        watch.lap("comparison")
        return replace(result, warnings=(*result.warnings, *wrong_tasks))


@dataclass(frozen=True)
class _View:
    """An epoch while it is worked on."""

    name: str
    source: ScanSource
    store: ReturnStore
    stations: StationIndexes
    sight: EpochSight
    occupied: Occupied
    place: float
    """See ``photo_campaign.place_sigma``."""
    alignment: AlignmentRecord

    @property
    def date(self) -> str:
        return max((s.acquired for s in self.source.stations), default="")


def _aligned(
    model: BuildingModel, samples: SurfaceSamples, source: ScanSource, options: ChangeOptions, name: str, progress: Progress
) -> AlignmentRecord:
    """The pose of one epoch. Raises BimVerifyError, with its name, when the geometry does not fix it."""
    try:
        return align(model, samples, source, options.align, sigma=options.sigma, loa=LOA, progress=progress)
    except BimVerifyError as error:
        raise BimVerifyError(f"The {name} cannot be aligned. {error}") from error


def _names(count: int) -> list[str]:
    return ["epoch"] if count == 1 else [f"epoch {n + 1}" for n in range(count)]


def _compare(
    model: BuildingModel, solids: SolidVoxels, world: Universe, views: list[_View], seen: list[Observation],
    has_reference: bool, plans: tuple[Planned, ...], options: ChangeOptions, watch: Stopwatch,
) -> ChangeResult:
    edge = solids.grid.edge
    now, before = views[-1], views[0] if has_reference else None
    day = parse_date(options.date or now.date)
    undated = day is None and any(p.dated for p in plans)
    days = [*(parse_date(v.date) for v in views[:-1]), day]
    last = len(views) - 1
    state = _states(world, views, seen, last, 0 if before else None)
    anything = np.zeros(state.shape, np.bool_)
    for epoch in seen:
        anything |= epoch.state != UNSEEN
    first: Absent | None = None
    between = common_shift(now.sight.fits.since(before.sight.fits)) if before else None
    alone, with_model, series = [], [], []
    for n, (view, epoch, its_day) in enumerate(zip(views, seen, days, strict=True)):
        of_view = state if n == last and before is None else _states(world, views, seen, n, None)
        with_model.append(count_states(of_view, anything, (view.name, MODEL)))
        gone = Absent.of(world, of_view)
        found = amounts(world, gone, None, epoch, len(model.elements))
        on_day = tuple(p.on(its_day) for p in plans)
        alone.append(_elements(model, solids, found, view.sight, None, on_day, its_day))
        series.append(group_progress(alone[-1], on_day, _weights(solids, on_day), its_day))
        first = gone if view is before else first
    plans = on_day
    elements = planned_now = alone[-1]  # against the model: what the plan is compared with
    if before is not None:
        both = amounts(world, gone, first, seen[-1], len(model.elements))
        elements = tuple(
            replace(e, expected=p.expected, agrees=p.agrees, progress=p.progress, standing_ratio=p.standing_ratio)
            for e, p in zip(
                _elements(model, solids, both, now.sight, before.sight, plans, day, _tolerance(between, edge, options)),
                planned_now, strict=True,
            )
        )
    remaining = tuple(
        n for n, e in enumerate(planned_now) if e.state == "PARTIAL" and not e.moved and e.disappeared_ratio > 0
    )
    cloud = voxel_cloud(world, state, anything, gone.cells)
    telling = [
        (v.name, o) for v, o in list(zip(views, seen, strict=True))[int(has_reference) :]
        if v is now or not (v.sight.place_open or now.sight.place_open)
    ]
    clusters, left_out = find_clusters(
        model, world, cloud, [e.state for e in elements], solids.held, telling, seen[0] if has_reference else None
    )
    anchor = solids.grid.anchor + model.origin
    records = [
        replace(_record(model, v), states=tuple(e.state for e in found), progress=groups)
        for v, found, groups in zip(views, alone, series, strict=True)
    ]
    if options.date:
        records[-1] = replace(records[-1], date=options.date)
    return ChangeResult(
        model=model, options=options, edge=edge, elements=elements,
        epochs=tuple(records[1:] if has_reference else records), reference=records[0] if has_reference else None,
        planned=plans, clusters=clusters, clusters_left_out=left_out,
        groups=series[-1], voxels=cloud,
        voxel_counts=_voxel_counts(world, views, seen, state, anything | gone.cells, with_model, has_reference),
        anchor=(float(anchor[0]), float(anchor[1]), float(anchor[2])),
        remaining=remaining, surfaces=held_voxels(world, [n for n in remaining if solids.by_surface[n]]),
        method=f"bim_verify {__version__} occupancy", offset_from_reference=between, timings=watch.seconds,
        warnings=tuple(_warnings(model, edge, options, views, has_reference, undated, left_out, between)),
    )


def _weights(solids: SolidVoxels, plans: tuple[Planned, ...]) -> list[float]:
    """Of each element in percent complete, m3: its planned volume; space that several take that count is divided equally."""
    counted = np.array([not plan.temporary for plan in plans], np.bool_)
    share = divided(solids.count, solids.element, solids.further, counted) / np.maximum(solids.count, 1)
    return [float(v) or OPEN_WEIGHT_M3 for v in solids.volume * share]


def _states(
    world: Universe, views: list[_View], seen: list[Observation], epoch: int, reference: int | None
) -> NDArray[np.uint8]:
    """(B, 512) between two epochs by their numbers, or an epoch and the model."""
    place_open = any(views[n].sight.place_open for n in (epoch, reference) if n is not None)
    state = compare(world, seen[epoch], None if reference is None else seen[reference], place_open)
    close_gone(world, seen[epoch], state)
    return state


def _voxel_counts(
    world: Universe, views: list[_View], seen: list[Observation], state: NDArray[np.uint8], shown: NDArray[np.bool_],
    with_model: list[VoxelCounts], has_reference: bool,
) -> tuple[VoxelCounts, ...]:
    """See ``ChangeResult.voxel_counts``; ``state`` (B, 512) of the comparison itself."""
    last = len(views) - 1
    pairs = [(n, n - 1) for n in range(1, len(views))] + ([(last, 0)] if last > 1 else [])
    main = count_states(state, shown, (views[-1].name, views[0].name if has_reference else MODEL))
    others = [
        count_states(_states(world, views, seen, n, m), shown, (views[n].name, views[m].name))
        for n, m in pairs if not (has_reference and (n, m) == (last, 0))
    ]
    return main, *others, *(with_model if has_reference else with_model[:-1])


def _elements(
    model: BuildingModel, solids: SolidVoxels, found: Sequence[Amount | None], now: EpochSight, before: EpochSight | None,
    plans: tuple[Planned, ...], day: date | None, least_tolerance: float = 0.0,
) -> tuple[ElementChange, ...]:
    """``least_tolerance`` [m] within which two places are the same, as far as the two epochs tell together."""
    tolerance = max(now.tolerance, before.tolerance, least_tolerance) if before else now.tolerance
    place_open = now.place_open or (before is not None and before.place_open)
    changes = []
    for row, element in enumerate(model.elements):
        mine, then = now.elements[row], before.elements[row] if before else None
        amount = found[row] or Amount()
        decision = element_state(model, row, mine, then, amount, tolerance)
        in_doubt = place_open and decision.state not in ("CONFIRMED", "UNKNOWN")
        if in_doubt:
            decision = undecided(decision)
        what = decision.state
        shares = ratios(decision, Amount() if place_open else found[row], mine, then)
        volume = float(solids.volume[row])
        expected = expected_state(plans[row], day)
        progress, agrees = judge(plans[row], expected, what)
        changes.append(ElementChange(
            element.global_id, element.ifc_class, element.name, element.storey, what, *shares, volume,
            disappeared_volume=shares[1] * volume, built_volume=(shares[0] + shares[2]) * volume,
            shift=_shift(mine, then), expected=expected, agrees=agrees, progress=progress, reason=decision.reason,
            moved=mine.seen == "MOVED" and not in_doubt, standing_ratio=standing_ratio(mine, what, shares),
        ))
    return tuple(changes)


def _tolerance(between: CommonShift | None, edge: float, options: ChangeOptions) -> float:
    """Metres within which two epochs do not tell two places apart that all elements are off by together."""
    if options.registration_sigma is not None or between is None or not between.significant:
        return 0.0
    return change_tolerance(edge, options.sigma, between.axis_sigma)


def _shift(now: Any, before: Any) -> float | None:
    if now.shift is None:
        return None
    if before is None or before.shift is None:
        return float(now.distance)
    return float(np.linalg.norm(np.array(now.shift) - np.array(before.shift)))


def _stated(model: BuildingModel) -> tuple[tuple[Planned, ...], Parts, tuple[str, ...]]:
    """What the file says of each element beside its shape: when it is to stand, and what it is a part of; and what is wrong
    with its tasks."""
    if not model.path or not Path(model.path).exists():
        return tuple(Planned() for _ in model.elements), frozenset(), ()
    file = open_ifc(model.path)
    return (
        read_planned(file, [(e.step_id, e.global_id) for e in model.elements]),
        read_parts(file, [e.step_id for e in model.elements]),
        tuple(reversed_tasks(file)),
    )


def _record(model: BuildingModel, view: _View) -> EpochRecord:
    return EpochRecord(
        view.name, view.source.paths, view.date, len(view.source.stations),
        sum(view.store.count(s) for s in range(len(view.store.stations))), view.occupied.count, view.occupied.sparse,
        view.sight.registration_sigma, (), view.sight.offset, found_ratio(view.sight), view.alignment,
    )


def _warnings(
    model: BuildingModel, edge: float, options: ChangeOptions, views: list[_View], has_reference: bool, undated: bool,
    left_out: int, between: CommonShift | None,
) -> Iterator[str]:
    off = [list(misplaced(view.name, MODEL, view.sight.offset, edge, options)) for view in views]
    for view, said in zip(views, off, strict=True):
        yield from said or strange(view.name, view.sight)
    if not any(off):
        yield from misplaced(views[-1].name, views[0].name, between, edge, options)
    yield from place_open([v.name for v in views if v.sight.place_open])
    if edge > options.voxel:
        yield (
            f"Voxels of {1000 * edge:g} mm are used instead of {1000 * options.voxel:g} mm, so that the model fits into "
            f"{options.memory_gb:g} GB."
        )
    level = supported_level(edge)
    if options.loa is not None and (level is None or options.loa > level):
        yield (
            f"LOA{options.loa} was asked for, but voxels of {1000 * edge:g} mm move a point by up to "
            f"{1000 * worst_voxel_shift(edge):.1f} mm, which supports {label(level)} at most "
            f"({label(supported_level(edge, relative=True))} for distances between voxels)."
        )
    if (place := max(view.place for view in views)) > 0.0:
        yield f"{adjusted_freely(place, options.registration_sigma)}, or state --registration-sigma-mm."
    for view in views:
        share = view.occupied.sparse / max(view.occupied.count, 1)
        if share > 0.01:
            yield (
                f"The {view.name} is sparse: {share:.0%} of its occupied voxels have fewer than {options.min_points} returns, "
                "and count because a surface there sends no more back."
            )
    yield from _order(views, has_reference)
    if undated:
        yield "The scans give no date, so dates of tasks were not used; give one with --date."
    if left_out:
        yield f"{left_out:,} smaller groups of new or gone voxels are not listed."
    yield from model.skipped


def _order(views: list[_View], has_reference: bool) -> Iterator[str]:
    """Dates of the scans against the order in which they were given."""
    dated = [(view.name, day) for view in views if (day := parse_date(view.date)) is not None]
    wrong = [(a, b) for a, b in pairwise(dated) if b[1] < a[1]]
    if wrong:
        said = ", ".join(f"the {b[0]} ({b[1]}) is older than the {a[0]} ({a[1]})" for a, b in wrong)
        given = "Give the earliest epoch first" + (", the reference before all others." if has_reference else ".")
        yield f"The scans' dates contradict the order given: {said}. {given}"
