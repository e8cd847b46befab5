"""Planning: from a model, and perhaps an existing campaign, to stations that reach a level of accuracy."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ..errors import BimVerifyError
from ..model.elements import BuildingModel
from ..model.sample_surface import sample_surface
from ..model.samples import SurfaceSamples
from ..planning.cover import CoverProblem, greedy, improve, make_problem, prove, shared_enough
from ..planning.existing import Existing, actions_of, clutter_props, start_from
from ..planning.forecast import forecast
from ..planning.options import PlanOptions
from ..planning.quick_start import quick_start
from ..planning.results import PlanResult, PlanStation
from ..planning.second_look import SecondLook, Views, area_by_element
from ..planning.targets import Targets, choose_elements, pick_targets
from ..planning.visibility import Requirement, registrable, view_matrix
from ..progress import Progress
from ..quality.options import QualityOptions
from ..scans.campaign import ScanSource
from ..simulation.scanner import PRESETS, Scanner
from ..simulation.scene import Scene, build_scene
from ..simulation.stand_points import StandPoints, find_stand_points
from .inputs import Stopwatch, limited_threads, open_model
from .quality import quality

Array = NDArray[np.float64]
SAMPLE_SPACING_M = 0.05
SAFETY = 0.03
"""Share of the reachable surface planned beyond the target, where it can be had: points stand for surface."""
LEAST_REACHABLE = 0.02
LINK_THINNER = 4.0
SAME_PLACE_M = 0.05
SECOND_THINNER = 0.5
"""The second set of points is twice as dense, and none of its points is in the first unless all are."""
MOST_LOOKS = 4
"""Solutions that are looked at on a second set of points."""


def plan(
    model: BuildingModel | str | Path,
    options: PlanOptions | None = None,
    progress: Progress | None = None,
    scans: ScanSource | Sequence[str | Path] = (),
) -> PlanResult:
    """Find the fewest stations that measure enough of every chosen element as the level needs.

    With ``scans``, the stations to add to that campaign. Nothing is written. Raises BimVerifyError with one sentence
    when a file cannot be used or no scanner can stand anywhere.
    """
    options = options or PlanOptions()
    progress = progress or Progress()
    if options.scanner != "auto" and options.scanner not in PRESETS:
        raise BimVerifyError(f"There is no scanner preset {options.scanner!r}; choose auto, {', '.join(PRESETS)}.")
    with limited_threads(options.threads):
        watch = Stopwatch()
        model = open_model(model, options, progress.part(0.0, 0.1))
        watch.lap("tessellation")
        samples = sample_surface(model, SAMPLE_SPACING_M, cache=options.cache)
        watch.lap("query positions")
        site = _site(model, samples, options, scans, progress.part(0.1, 0.3))
        watch.lap("places")
        if options.scanner != "auto":
            return _plan(site, options, PRESETS[options.scanner], progress.part(0.3, 1.0), watch)
        tried = []
        for k, scanner in enumerate(PRESETS.values()):
            part = progress.part(0.3 + 0.7 * k / len(PRESETS), 0.3 + 0.7 * (k + 1) / len(PRESETS))
            tried.append(_plan(site, options, scanner, part, watch))
        return min(tried, key=lambda p: (-p.summary()["elements_reached"], p.minutes))


@dataclass(frozen=True)
class _Site:
    """What does not depend on the scanner."""

    model: BuildingModel
    samples: SurfaceSamples
    chosen: NDArray[np.bool_]
    scene: Scene
    stands: StandPoints
    quality: object | None


def _site(
    model: BuildingModel, samples: SurfaceSamples, options: PlanOptions, scans: ScanSource | Sequence[str | Path],
    progress: Progress,
) -> _Site:
    chosen = choose_elements(model, options)
    found = None
    props = []
    if not isinstance(scans, Sequence) or len(scans):
        found = quality(
            model, scans,
            QualityOptions(
                loa=options.loa, sample_spacing=SAMPLE_SPACING_M, scan_frame=options.scan_frame, origin=options.origin,
                threads=options.threads, memory_gb=options.memory_gb, cache=options.cache,
            ),
            progress,
        )
        props = clutter_props(found)
        samples = found.samples
    scene = build_scene(model, {}, props)
    stands = find_stand_points(model, scene, count=options.candidates, seed=options.seed)
    if not len(stands.position):
        raise BimVerifyError(f"{model.path} leaves no free place for a scanner on a level floor; there is nothing to plan.")
    return _Site(model, samples, chosen, scene, stands, found)


def _plan(site: _Site, options: PlanOptions, scanner: Scanner, progress: Progress, watch: Stopwatch) -> PlanResult:
    from ..quality.results import QualityResult

    model, need = site.model, Requirement.of(options, scanner)
    targets = pick_targets(site.samples, site.chosen)
    if not len(targets):
        raise BimVerifyError(f"Nothing of the chosen elements of {model.path} can be seen from anywhere.")
    existing = start_from(site.quality, targets, need) if isinstance(site.quality, QualityResult) else None
    positions, known = site.stands.position, 0
    if existing is not None:
        known = len(existing.positions)
        # its places come twice: as they were scanned, and to be scanned again with this scanner
        positions = np.concatenate([existing.positions, existing.positions, positions])
    second = pick_targets(site.samples, site.chosen, offset=1, thinner=SECOND_THINNER)
    good = start_from(site.quality, second, need).good if isinstance(site.quality, QualityResult) else None
    sees, sees_second = (
        _views(site, positions, known, points, scanner, need, seen, progress.part(*part))
        for points, seen, part in (
            (targets, existing.good if existing else None, (0.0, 0.4)), (second, good, (0.4, 0.7))
        )
    )
    watch.lap("visibility")
    count = len(model.elements)
    area = np.bincount(targets.element, weights=targets.area, minlength=count).astype(np.float64)
    can = [
        area_by_element(points.area, points.element, seen.any(axis=0), count)
        for points, seen in ((targets, sees), (second, sees_second))
    ]
    reach = (SECOND_THINNER * can[0] + can[1]) / (1.0 + SECOND_THINNER) / np.maximum(area, 1e-12)
    reach = np.where(reach >= LEAST_REACHABLE, reach, 0.0)
    target = options.coverage * reach
    aim = (target + SAFETY * reach) * area
    # stations are registered by all that they see in common, whether the plan asks for it or not
    common = pick_targets(site.samples, np.ones(len(model.elements), np.bool_), thinner=LINK_THINNER)
    scans_share = view_matrix(site.scene, positions, common, scanner, registrable(scanner), progress.part(0.7, 0.8))
    linked = shared_enough(scans_share, common.area, options.overlap)
    look = SecondLook(sees_second, second.area, second.element, target * area, aim)
    views = Views(sees, targets.area, targets.element, np.minimum(aim, can[0]) * (1.0 - 1e-9))
    problem, chosen, heuristic, least = _solved(
        views, look, linked, known, partial(_quick, site, positions, targets, scanner, need), options
    )
    watch.lap("solving")
    new = [c for c in chosen if c >= known]
    watch_order = _in_order(problem, new, known)
    stations = tuple(_stations(site, existing, problem, sees, targets, watch_order, known, positions, scanner, options))
    everything = pick_targets(site.samples, np.ones(count, np.bool_), offset=1, thinner=SECOND_THINNER)
    seen_already = start_from(site.quality, everything, need).good if isinstance(site.quality, QualityResult) else None
    forecasts = forecast(
        model, site.samples, site.scene, everything, positions[watch_order], scanner, options, site.chosen, reach, target,
        seen_already,
    )
    watch.lap("forecast")
    return PlanResult(
        model=model, options=options, scanner=scanner, stations=stations, existing=existing.names if existing else (),
        forecasts=tuple(forecasts), least=least, optimal=len(new) <= least, places=len(site.stands.position),
        heuristic=heuristic, method=f"bim_verify {__version__} plan", timings=dict(watch.seconds),
        warnings=tuple(_warnings(problem, chosen, site, reach)),
    )


def _linked_to_known(problem: CoverProblem) -> CoverProblem:
    """Existing stations are registered to each other, and a new one to any of them whose place it shares."""
    known = problem.known
    if not len(known):
        return problem
    linked = problem.linked.copy()
    linked[np.ix_(known, known)] = True
    return replace(problem, linked=linked)


def _views(
    site: _Site, positions: Array, known: int, points: Targets, scanner: Scanner, need: Requirement,
    already: NDArray[np.bool_] | None, progress: Progress,
) -> NDArray[np.bool_]:
    """(C, P) what each place measures as required; stations of the campaign, the first ``known``, all that it has."""
    sees = view_matrix(site.scene, positions[known:], points, scanner, need, progress)
    return sees if already is None else np.concatenate([np.repeat(already[None], known, axis=0), sees])


def _quick(site: _Site, positions: Array, targets: Targets, scanner: Scanner, need: Requirement) -> list[int]:
    return list(quick_start(site.scene, positions, targets, scanner, need, most=3))


def _solved(
    views: Views, look: SecondLook, linked: NDArray[np.bool_], known: int, quick: Callable[[], list[int]], options: PlanOptions
) -> tuple[CoverProblem, list[int], int, int]:
    """(problem, places, size of the heuristic's solution, least possible size), new places counted.

    What falls short on the second set of points joins the problem with it. The bound is that of the problem before: what
    joins can only ask for more.
    """
    joined = np.zeros(len(look.target), np.bool_)
    least = None
    for _ in range(MOST_LOOKS):
        problem = make_problem(views.sees, views.area, views.element, views.need, range(known), linked)
        problem = _linked_to_known(problem)
        chosen, heuristic, bound = _solve(problem, quick, options)
        least = bound if least is None else least
        short = look.lacking(chosen) & ~joined
        if not short.any():
            break
        joined |= short
        views = look.join(views, short)
    return problem, chosen, heuristic, min(least or 0, sum(c >= known for c in chosen))


def _solve(
    problem: CoverProblem, quick: Callable[[], list[int]], options: PlanOptions
) -> tuple[list[int], int, int]:
    """(places, size of the heuristic's solution, least possible size) with the new places counted."""
    starts: list[int | None] = [None]
    if not len(problem.known):
        starts += quick()
    tried = [improve(problem, greedy(problem, first)) for first in starts]
    best = min(tried, key=lambda c: (not problem.satisfied(c), len(c)))
    size = len(best) - len(problem.known)
    if not problem.satisfied(best):
        problem = replace(problem, need=np.minimum(problem.need, problem.covered(best)) * (1 - 1e-9))
    proof = prove(problem, size, options.solve_seconds)
    if proof.chosen is not None and len(set(proof.chosen) - set(problem.known.tolist())) <= size:
        best = proof.chosen
    final = len(set(best) - set(problem.known.tolist()))
    return best, size, min(proof.least, final)


def _in_order(problem: CoverProblem, new: list[int], known: int) -> list[int]:
    """The order to scan in: each next station is linked to one before and adds most."""
    done: list[int] = list(range(known))
    left = set(new)
    order = []
    while left:
        near = [c for c in left if not done or problem.linked[c, done].any()] or list(left)
        seen = problem.sees[done].any(axis=0) if done else np.zeros(len(problem.weight), np.bool_)
        best = max(near, key=lambda c: (float(problem.weight[problem.sees[c] & ~seen].sum()), -c))
        order.append(best)
        done.append(best)
        left.discard(best)
    return order


def _stations(
    site: _Site, existing: Existing | None, problem: CoverProblem, sees: NDArray[np.bool_], targets: Targets,
    order: list[int], known: int, positions: Array, scanner: Scanner, options: PlanOptions,
) -> Iterator[PlanStation]:
    seen = existing.good.copy() if existing else np.zeros(len(targets), dtype=np.bool_)
    beams = scanner.grid.rows * scanner.grid.columns
    names = {k: existing.names[k] for k in range(known)} if existing else {}
    names |= {c: f"set-up {k + 1}" for k, c in enumerate(order)}
    for place, c in enumerate(order):
        fresh = np.flatnonzero(sees[c] & ~seen)
        actions: tuple[str, ...] = ()
        if existing is not None:
            away = np.linalg.norm(existing.positions - positions[c], axis=1)
            nearest = int(np.argmin(away))
            finer = scanner.angular_step < 0.9 * float(existing.steps[nearest])
            distance = np.linalg.norm(targets.position[fresh] - positions[c], axis=1)
            actions = actions_of(existing, fresh, distance, targets.area, finer, bool(away[nearest] < SAME_PLACE_M))
        gained = np.bincount(targets.element[fresh], weights=targets.area[fresh], minlength=len(problem.need))
        helped = [site.model.elements[e].global_id for e in np.flatnonzero((gained > 0) & (problem.need > 0))]
        seen |= sees[c]
        position = positions[c] + site.model.origin
        floor = None
        if c >= 2 * known:
            floor = float(site.stands.floor[c - 2 * known] + site.model.origin[2])
        yield PlanStation(
            name=names[c], position=(float(position[0]), float(position[1]), float(position[2])), floor=floor,
            minutes=options.setup_minutes + beams / options.points_per_second / 60.0,
            area=float(targets.area[sees[c]].sum()), new_area=float(targets.area[fresh].sum()),
            linked_to=tuple(names[o] for o in [*range(known), *order[:place]] if problem.linked[c, o]),
            actions=actions, for_elements=tuple(helped),
        )


def _warnings(problem: CoverProblem, chosen: list[int], site: _Site, reach: Array) -> Iterator[str]:
    out = int(((reach <= 0) & site.chosen).sum())
    if out:
        yield f"{out} of the chosen elements cannot be measured as required from any place looked at; they are left out."
    parts = problem.parts(chosen)
    if len(parts) > 1:
        yield (
            f"The stations fall into {len(parts)} groups that share no surface: register them to each other by targets or "
            "control points."
        )
    short = len(set(np.flatnonzero(problem.covered(chosen) < problem.need - 1e-6) % len(reach)))
    if short:
        yield f"{short} elements keep less than asked for, because no linked place adds to them."
    if math.isinf(float(np.max(site.stands.floor, initial=0.0))):
        yield "Some places have no floor in the model below them."
    yield from site.model.skipped
