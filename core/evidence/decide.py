"""The decision per element."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ..model.elements import BuildingModel
from ..model.samples import SurfaceSamples
from ..results import LEVELS, ElementVerdict, SampleEvidence, Status
from ..sensing.loa import UPPER_BOUND_M, label, level_sigma
from .displacement import Shift, fit_shift
from .error_model import ErrorModel
from .hypotheses import candidate_shifts
from .sightings import AT, BEYOND, FRONT, SEARCH_M, Sightings
from .thresholds import Thresholds

STILL_AT_PLAN = 0.6
"""A place this much of the window, or less, from the plan is no other place: at its plan the element was not found."""


@dataclass(frozen=True)
class Context:
    """What the decisions on all elements share."""

    loa: int
    sigma: float
    registration_sigma: float
    errors: ErrorModel
    window: float
    """Half-width along the normal within which an element stands at its place, metres."""
    see_through: bool
    """Whether this campaign's rays pass planned glass."""
    thresholds: Thresholds
    station_names: tuple[str, ...]


@dataclass(frozen=True)
class Place:
    """How well one place of an element (planned or shifted) agrees with what was seen. Areas in m2."""

    shift: NDArray[np.float64]
    at: float
    beyond: float
    hidden: float
    exposed: float
    """What could be seen of it there."""
    sightings: int
    rays: int
    """Different returns that tell something about it."""
    stations: tuple[int, ...]
    fit: Shift
    """Shift against the plan (not against this place)."""

    @property
    def share(self) -> float:
        """Share of what was seen of the element that is at this place."""
        return self.at / max(self.at + self.beyond, 1e-12)


def assess_place(
    shift: NDArray[np.float64], seen: Sightings, area: NDArray[np.float64], exposed: float, context: Context
) -> Place:
    """Assess one place, with ``exposed`` m2, from its sightings ``seen`` (M) and the ``area`` (M,) [m2] each stands for."""
    state = seen.state(context.window)
    at = (state == AT) & seen.on_face
    beyond = (state == BEYOND) & seen.on_face
    shared = shared_area(seen, area, at | beyond)
    front = (state == FRONT) & seen.on_face
    return Place(
        shift, float(shared[at].sum()), float(shared[beyond].sum()), float(shared_area(seen, area, front).sum()), exposed,
        int((at | beyond).sum()), len(np.unique(seen.ray_key(at | beyond))),
        tuple(np.unique(seen.station[at | beyond]).tolist()), fit_shift(seen.rows(at), context.errors).plus(shift),
    )


def shared_area(
    seen: Sightings, area: NDArray[np.float64], telling: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(M,) m2: each query's ``area`` (M,) shared by those of its sightings that are ``telling`` (M,), zero for the others.

    A station that looks at something before the query says nothing about it and takes no share.
    """
    _, query = np.unique(seen.sample, return_inverse=True)
    count = np.bincount(query.ravel(), weights=telling)
    return np.where(telling, area / np.maximum(count[query.ravel()], 1), 0.0)


def enough_seen(place: Place, share: float, t: Thresholds) -> bool:
    """Whether what was seen, the ``share`` of the exposed surface, is evidence at all."""
    if share < t.least_seen_share or place.sightings < t.least_sightings:
        return False
    return share >= t.partial_coverage or place.rays * share >= t.least_rays_share


def propose(
    seen: Sightings, local: NDArray[np.int64], samples: SurfaceSamples, context: Context
) -> NDArray[np.float64]:
    """Shifts (K, 3) worth a second look for an element that does not simply stand at its place."""
    if len(seen) == 0:
        return np.zeros((0, 3))
    usable = seen.on_face & ~seen.explained
    tells = seen.on_face & ~(seen.explained & (seen.deviation > 0)) & (seen.deviation <= SEARCH_M)
    weight = shared_area(seen, samples.area[local], tells)
    return candidate_shifts(seen.deviation, samples.normal[local], weight, usable, STILL_AT_PLAN * context.window)


def choose(plan: Place, others: list[Place], context: Context) -> Place:
    """The place that explains most of an element; the plan unless another is clearly better."""
    best = plan
    for place in others:
        if place.at < context.thresholds.moved_seen_share * place.exposed or not len(place.fit.determined):
            continue
        if np.linalg.norm(place.fit.vector) <= STILL_AT_PLAN * context.window:
            continue
        if not enough_seen(place, (place.at + place.beyond) / max(place.exposed, 1e-12), context.thresholds):
            continue
        if place.share >= context.thresholds.present_share and place.at > context.thresholds.moved_gain * max(
            best.at * (best.share if best is plan else 1.0), 1e-9
        ):
            best = place
    return best


def conclude(
    number: int, model: BuildingModel, samples: SurfaceSamples, rows: slice, evidence: SampleEvidence,
    plan: Place, best: Place, context: Context, beside: float = 0.0,
) -> ElementVerdict:
    """The verdict on element ``number`` whose samples are ``rows``; ``beside``: ``beside.shares_beside``."""
    t = context.thresholds
    element = model.elements[number]
    exposed = samples.exposed[rows]
    area = samples.area[rows][exposed]
    whole = float(area.sum())
    occ, emp, unk, conflict = (
        _mean(getattr(evidence, name)[rows][exposed], area) for name in ("m_occ", "m_emp", "m_unk", "conflict")
    )
    deviation = evidence.deviation[rows][exposed].astype(np.float64)
    measured = np.isfinite(deviation)
    bound = UPPER_BOUND_M[context.loa]
    seen_area = plan.at + plan.beyond
    observed = int(measured.sum())

    ratio, achieved = _levels(deviation[measured], evidence.sigma[rows][exposed][measured], area[measured],
                              seen_area, context)
    vector, sigma, length, significant = _test(best.fit, context)
    standing = standing_shares(element.ifc_class, model.transparent[samples.triangle[rows]], t)
    status, reason = _status(plan, best, whole, seen_area, ratio[context.loa], length, bound, standing, beside, context)
    near = np.abs(deviation[measured]) <= bound + 2.0 * context.registration_sigma
    near_share = area[measured][near].sum() / max(seen_area, float(area[measured].sum()), 1e-12)
    if not significant and _open(status, length if length is not None else 0.0, best is plan, near_share, bound, context):
        status, reason = "PARTIAL", _too_uncertain(length, context)
    if status in ("ABSENT", "NOTOBSERVED"):
        vector = sigma = length = significant = None
    if status == "ABSENT" and 2.0 * context.registration_sigma > SEARCH_M:
        status, reason = "PARTIAL", _too_uncertain(None, context)
    if (status in ("ABSENT", "NOTOBSERVED", "DEVIATING") and best is not plan) or status in ("ABSENT", "NOTOBSERVED"):
        achieved = next((k for k in reversed(LEVELS) if length is not None and length <= UPPER_BOUND_M[k]), None)
    near = measured if status not in ("ABSENT", "NOTOBSERVED") else np.zeros_like(measured)
    return ElementVerdict(
        global_id=element.global_id, ifc_class=element.ifc_class, name=element.name, storey=element.storey,
        status=status, required_loa=label(context.loa), achieved_loa=label(achieved),
        belief_occupied=occ, belief_empty=emp, belief_unknown=unk if whole > 0 else 1.0, conflict=conflict,
        coverage=1.0 - unk if whole > 0 else 0.0, confirmed_ratio=ratio,
        sample_count=rows.stop - rows.start, observed_count=observed, area=whole,
        deviation_median=_weighted_quantile(deviation[near], area[near], 0.5),
        deviation_p95=_weighted_quantile(np.abs(deviation[near]), area[near], 0.95),
        displacement=length, displacement_vector=vector, displacement_sigma=sigma, significant=significant,
        measurement_sigma=context.sigma, registration_sigma=context.registration_sigma,
        reason=reason, stations=tuple(context.station_names[s] for s in best.stations),
    )


def _open(
    status: Status, length: float, at_plan: bool, near_share: float, bound: float, context: Context
) -> bool:
    """Whether an error of the registration alone may have led to ``status``, of an element that was found ``length`` [m] off.

    ``near_share`` of what was seen lies as near to the plan as such an error and the ``bound`` [m] reach.
    """
    if status not in ("CONFIRMED", "DEVIATING") or (at_plan and near_share < context.thresholds.present_share):
        return False
    shape = status == "DEVIATING" and at_plan and length <= bound
    return context.registration_sigma > (level_sigma(context.loa) if shape else bound)


def _too_uncertain(length: float | None, context: Context) -> str:
    """Why a place or a shape cannot be told from an error of the registration."""
    known = f"the stations' place is known to {1000 * context.registration_sigma:.0f} mm only (one sigma)"
    where = "What was seen" if length is None else f"It seems to stand {1000 * length:.1f} mm from its planned place; that"
    return f"{where} cannot be decided at {label(context.loa)}: {known}."


GLAZED = ("IfcWindow", "IfcDoor", "IfcCurtainWall", "IfcRoofLight")
"""Classes that usually hold panes, marked as glass or not."""


def standing_shares(ifc_class: str, transparent: NDArray[np.bool_], t: Thresholds) -> tuple[float, float]:
    """(absent up to this share at the place, present from this share on).

    ``transparent`` (K,) of the element's own surface: a glazed class without any has panes that are not marked.
    """
    pane_unmarked = ifc_class.startswith(GLAZED) and not transparent.any()
    return (t.glazed_share, t.glazed_share) if pane_unmarked else (t.absent_share, t.present_share)


def _mean(values: NDArray[np.float32], area: NDArray[np.float64]) -> float:
    return float(np.average(values.astype(np.float64), weights=area)) if area.sum() > 0 else 0.0


def _weighted_quantile(values: NDArray[np.float64], weight: NDArray[np.float64], share: float) -> float | None:
    if not len(values):
        return None
    order = np.argsort(values)
    cumulative = np.cumsum(weight[order])
    return float(values[order][min(int(np.searchsorted(cumulative, share * cumulative[-1])), len(values) - 1)])


def _levels(
    deviation: NDArray[np.float64], sigma: NDArray[np.float32], area: NDArray[np.float64], seen_area: float,
    context: Context,
) -> tuple[dict[int, float], int | None]:
    """Share of the observed surface confirmed at each level, and the highest level that is reached.

    A position is confirmed at a level when its deviation is within the level's bound and the measurement is able to tell:
    its standard deviation, registration included, is no larger than the level's own.
    """
    total = np.hypot(sigma.astype(np.float64), context.registration_sigma)
    denominator = max(seen_area, float(area.sum()), 1e-12)
    ratio = {
        k: float(area[(np.abs(deviation) <= UPPER_BOUND_M[k]) & (total <= level_sigma(k))].sum()) / denominator
        for k in LEVELS
    }
    reached = [k for k in LEVELS if ratio[k] >= context.thresholds.uniform_share]
    return ratio, max(reached) if reached else None


def _test(
    fit: Shift, context: Context
) -> tuple[tuple[float, float, float] | None, float | None, float | None, bool | None]:
    """Shift vector, its sigma along itself, its length, and whether it differs from zero at 95 %.

    The test counts measurement and unevenness (the fit), registration, and the model's own sigma at the required level.
    """
    k = len(fit.determined)
    if k == 0:
        return None, None, None, None
    registration = context.registration_sigma * context.errors.registration.widening
    covariance = fit.covariance + registration**2 * fit.registration
    length = float(np.linalg.norm(fit.vector))
    axis = fit.vector / length if length > 1e-12 else fit.determined[0]
    sigma = math.sqrt(float(axis @ covariance @ axis))
    inside = fit.determined @ (covariance + level_sigma(context.loa) ** 2 * np.eye(3)) @ fit.determined.T
    component = fit.determined @ fit.vector
    statistic = float(component @ np.linalg.solve(inside, component))
    x, y, z = (float(v) for v in fit.vector)
    return (x, y, z), sigma, length, bool(statistic > chdtri(k, 0.05))


def _status(
    plan: Place, best: Place, whole: float, seen_area: float, ratio: float, length: float | None, bound: float,
    standing: tuple[float, float], beside: float, context: Context,
) -> tuple[Status, str]:
    t = context.thresholds
    share = seen_area / max(whole, 1e-12)
    mm = f"{1000 * length:.1f} mm" if length is not None else "an undetermined amount"
    if best is not plan:
        place = f"It stands {mm} from its planned place, where {best.share:.0%} of what was seen of it fits"
        if length is not None and length <= bound:
            return "CONFIRMED", f"{place}; that is within {label(context.loa)}."
        less = f"only {plan.share:.0%} fits" if plan.share < best.share else f"only {plan.at:.2f} m2, not {best.at:.2f} m2, fit"
        return "DEVIATING", f"{place}; {less} the plan. {label(context.loa)} allows {1000 * bound:.0f} mm."
    if whole <= 0:
        return "NOTOBSERVED", "Other elements touch or enclose its whole surface, so nothing can see it."
    if not enough_seen(plan, share, t):
        return "NOTOBSERVED", (
            f"Only {share:.1%} of its exposed surface was in view of a station, of {plan.rays} rays; that is no evidence."
        )
    absent_up_to, present_from = standing
    if plan.share <= absent_up_to and share < t.absent_seen_share:
        return "PARTIAL", (
            f"Rays passed through {1 - plan.share:z.0%} of what was in view, "
            f"but that is only {share:.1%} of its exposed surface."
        )
    if plan.share <= absent_up_to < plan.share + (1.0 - plan.share) * beside:
        return "PARTIAL", (
            f"Rays passed through {1 - plan.share:z.0%} of what was in view, but something that no other element explains "
            "stands within the tolerance beside it, and may be it: it is too slender to tell."
        )
    if plan.share <= absent_up_to:
        return "ABSENT", (
            f"Rays passed through {1 - plan.share:z.0%} of the {share:.0%} of its surface that was in view, "
            "and it was not found nearby."
        )
    if plan.share < present_from:
        return "PARTIAL", f"{plan.share:.0%} of what was in view is at its place; rays passed through the rest."
    if length is not None and length > bound:
        return "DEVIATING", f"It stands {mm} from its planned place; {label(context.loa)} allows {1000 * bound:.0f} mm."
    if ratio < t.present_share and plan.share >= t.uniform_share:
        return "DEVIATING", (
            f"Only {ratio:.0%} of the observed surface lies within {1000 * bound:.0f} mm of the plan, "
            "though the element as a whole has not shifted: its shape differs."
        )
    if share < t.partial_coverage:
        return "PARTIAL", f"What was seen fits the plan, but only {share:.0%} of its exposed surface was in view."
    if ratio < t.uniform_share:
        return "PARTIAL", (
            f"{ratio:.0%} of the observed surface lies within {1000 * bound:.0f} mm of the plan; the rest does not."
        )
    return "CONFIRMED", (
        f"{ratio:.0%} of the observed surface lies within {1000 * bound:.0f} mm of the plan; "
        f"{share:.0%} of its exposed surface was in view; shift {mm}."
    )
