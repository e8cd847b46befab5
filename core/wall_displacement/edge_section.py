"""What returns near the edge of a joint look like: the section that beams meet, and how likely depths are under it.

The section of an edge is the face, then a slope (a chamfer; none where edges are sharp) down to a depth, then the side of the
panel, or that of the next one where rays climb towards it, and the back of the gap. A groove of the face's relief meets the
edge behind the face. A beam that meets two of them reports a depth between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .epoch import spread_rows

Array = NDArray[np.float64]
PROFILE_STEP_M = 0.0004
FAST = {"reassoc", "contract", "nsz", "arcp"}
"""Sums in any order: rounding only."""
CHANCE_OF_STRAY = 0.01
"""Share of returns near an edge that neither face, flank nor gap explains: of beams that meet two of them."""


@dataclass(frozen=True)
class Samples:
    """Heights v (N,) at which rays cross the face [m], depth (N,) of their returns behind it [m], place x (N,) along the joint.

    The recess lies on the side of larger v; for an upper edge heights are mirrored.
    """

    v: Array
    depth: Array
    x: Array
    rise: float
    """Of the rays: change of v per metre of depth."""
    lean: float
    """Of the face: change of its depth y per metre of v. A flank turns with its panel."""
    noise: float
    """Mean absolute distance of the face's own returns from it [m]."""
    relief: float
    """Deepest relief of the face [m]."""
    rough: float
    """Share of the face's returns that lie in relief."""
    groove: float
    """How far behind the face its relief lies, and the mean absolute distance of returns from that [m]."""
    groove_noise: float
    deepest: float
    """How far behind the face beams go that enter the gap [m]."""
    level_sigma: float = 0.0
    """Standard deviation of the face's depth [m]."""
    gap: float = math.inf
    """Height between the side faces of the two panels [m]."""
    about: tuple[float, float] = (0.0, math.inf)
    """Where the side face is, roughly, and how far off that may be [m]."""


@dataclass(frozen=True)
class Flank:
    """Depth [m] at which the slope ends, and height over depth of the slope; what blurs it."""

    depth: float
    slope: float
    beam: float = 0.0
    """Radius of the beams on the wall [m]."""
    aim: float = 0.0003
    """How far single beams meet the wall from where their angles say, and edges lie off a straight line [m]."""


def cost_of(places: Array, flank: Flank, samples: Samples) -> Array:
    """(K,) negative log likelihood of the samples for each place of the corner."""
    return np.asarray(_costs(places, *_known(flank, samples)))


def unlikeliness(places: Array, count: int, flank: Flank, samples: Samples) -> float:
    """Negative log of the likelihood of the samples, ``count`` places being equally likely, all but these impossible."""
    return float(_over_places(places, count, *_known(flank, samples)))


def _known(flank: Flank, samples: Samples) -> tuple[float | Array, ...]:
    return (
        flank.slope, flank.depth, flank.beam, flank.aim, samples.rise - samples.lean, samples.v, samples.depth,
        samples.noise, samples.rough, samples.groove, samples.groove_noise, samples.deepest,
        samples.gap + flank.slope * flank.depth,
    )


@njit(cache=True, nogil=True)
def flank_profile(slope, deep, beam, rise, deepest, opposite=math.inf, floor=0.0, margin=0.0):  # type: ignore[no-untyped-def]
    """Depths that beams report at heights from ``-beam - margin`` on, ``PROFILE_STEP_M`` apart; rays climb by ``rise`` a depth.

    Within a beam all surfaces count by the beam's power there (a normal distribution, its radius two standard deviations)
    and by the cosine of incidence: the face (or what lies ``floor`` behind it in a groove), the slope, the side of the
    panel where rays see it or that of the next panel, ``opposite`` above the corner, where they see that, and the back of
    the gap.
    """
    height = max((slope - rise) * deep, 0.0) if slope > 0 else 0.0
    first = deep if slope > 0 else 0.0
    side = max(-rise, 0.0)
    count = int((height + 2.0 * (beam + margin)) / PROFILE_STEP_M) + 2
    out = np.empty(count)
    reach = int(beam / PROFILE_STEP_M)
    on_slope = (slope - rise) / math.sqrt(1.0 + (slope - rise) ** 2)
    on_side = abs(rise) / math.sqrt(1.0 + rise**2)
    # along the beam's section, then weighed
    cells = count + 2 * reach
    depth, shade = np.empty(cells), np.empty(cells)
    for k in range(cells):
        t = (k - reach) * PROFILE_STEP_M - beam - margin
        if t < (slope - rise) * floor:
            depth[k], shade[k] = floor, 1.0
        elif height > 0.0 and t < height:
            depth[k], shade[k] = max(t / (slope - rise), floor), on_slope
        elif side > 0.0 and first + (t - height) / side < deepest:
            depth[k], shade[k] = max(first + (t - height) / side, floor), on_side
        elif rise > 0.0 and opposite - t < rise * deepest:
            depth[k], shade[k] = max((opposite - t) / rise, first, floor), on_side
        else:
            depth[k], shade[k] = deepest, 1.0
    power = np.empty(2 * reach + 1)
    for j in range(-reach, reach + 1):
        power[j + reach] = math.exp(-2.0 * (j * PROFILE_STEP_M / max(beam, PROFILE_STEP_M)) ** 2)
    for k in range(count):
        out[k] = _weighed(power, shade[k : k + power.size], depth[k : k + power.size])
    return out


@njit(cache=True, nogil=True, fastmath=FAST)
def _weighed(power, shade, depth):  # type: ignore[no-untyped-def]
    """Mean depth by power times shade."""
    total, mean = 0.0, 0.0
    for j in range(power.size):
        share = power[j] * shade[j]
        total, mean = total + share, mean + share * depth[j]
    return mean / total


@njit(cache=True, nogil=True)
def _blur(profile, aim, noise):  # type: ignore[no-untyped-def]
    """How far depths scatter about a profile: noise, and what it changes within ``aim``."""
    apart = max(round(aim / PROFILE_STEP_M), 1)
    last = profile.size - 1
    out = np.empty(profile.size)
    for k in range(profile.size):
        low, high = max(k - apart, 0), min(k + apart, last)
        out[k] = noise + abs(profile[high] - profile[low]) * aim / ((high - low) * PROFILE_STEP_M)
    return out


@njit(cache=True, nogil=True)
def _costs(  # type: ignore[no-untyped-def]
    places, slope, deep, beam, aim, rise, v, depth, noise, rough, groove, groove_noise, deepest, opposite
):
    """Negative log likelihood of the depths for each place of the corner; ``v`` ascending.

    On the face: Laplace noise, relief of the face, strays. Near the edge the same about what beams report there. In the
    gap: any depth from ``deep`` to as far as beams go.
    """
    # rays that climb away from the slope see less of it
    height = max((slope - rise) * deep, 0.0) if slope > 0 else 0.0
    before_edge = beam + 2.0 * aim + max(rise - slope, 0.0) * groove
    margin = before_edge - beam
    face = flank_profile(slope, deep, beam, rise, deepest, opposite, 0.0, margin)
    grooved = flank_profile(slope, deep, beam, rise, deepest, opposite, groove, margin)
    face_wide, grooved_wide = _blur(face, aim, noise), _blur(grooved, aim, groove_noise)
    if height > 0.0:
        # a groove may go straight through the slope, or run out with it
        for k in range(face.size):
            t = (k * PROFILE_STEP_M - before_edge) / height
            out = max(groove * (1.0 - max(t, 0.0)), 0.0)
            apart = 0.5 * max(face[k] + out - grooved[k], 0.0)
            grooved[k], grooved_wide[k] = grooved[k] + apart, grooved_wide[k] + apart
    reach = max(deepest, deep) + 0.02
    known = max(1.0 - rough - CHANCE_OF_STRAY, 0.01)
    share = max(rough, CHANCE_OF_STRAY)
    face_log, grooved_log = np.log(2.0 * face_wide / known), np.log(2.0 * grooved_wide / share)
    log_noise, log_groove = math.log(2.0 * noise / known), math.log(2.0 * groove_noise / share)
    log_stray = math.log(reach / CHANCE_OF_STRAY)
    log_gap = math.log(max(reach - deep, 1e-3))
    size = v.size
    before = np.zeros(size + 1)  # cost of all samples to the left, on the face
    after = np.zeros(size + 1)  # in the gap
    for i in range(size):
        on_face = min(abs(depth[i]) / noise + log_noise, abs(depth[i] - groove) / groove_noise + log_groove, log_stray)
        in_gap = min(max(deep - depth[i], 0.0) / noise + log_gap, log_stray)
        before[i + 1] = before[i] + on_face
        after[i + 1] = after[i] + in_gap
    out = np.empty(places.size)
    for k in range(places.size):
        low = np.searchsorted(v, places[k] - before_edge, side="right")
        high = np.searchsorted(v, places[k] + height + before_edge, side="right")
        above = np.searchsorted(v, places[k] + height, side="right")
        first = places[k] - before_edge
        out[k] = before[low] + after[size] - after[high]
        for start, end, gap in ((low, above, math.inf), (above, high, log_gap + math.log(2.0))):
            out[k] += _near_edge(
                v[start:end], depth[start:end], first, face, face_wide, face_log, grooved, grooved_wide, grooved_log,
                log_stray, deep, noise, gap,
            )
    return out


@njit(cache=True, nogil=True)
def _over_places(  # type: ignore[no-untyped-def]
    places, count, slope, deep, beam, aim, rise, v, depth, noise, rough, groove, groove_noise, deepest, opposite
):
    cost = _costs(
        places, slope, deep, beam, aim, rise, v, depth, noise, rough, groove, groove_noise, deepest, opposite
    )
    least = cost.min()
    return least - math.log(np.exp(least - cost).sum() / count)


@njit(cache=True, nogil=True, fastmath=FAST)
def _near_edge(  # type: ignore[no-untyped-def]
    v, depth, first, face, face_wide, face_log, grooved, grooved_wide, grooved_log, log_stray, deep, noise, log_gap
):
    """Cost of samples that may meet the edge, or have come back from the gap where that costs less than infinity."""
    total, last, one = 0.0, face.size - 2, np.uint64(1)
    for i in range(v.size):
        at = (v[i] - first) / PROFILE_STEP_M
        whole = min(int(at), last)
        part = at - whole
        cell = np.uint64(whole)  # an index without a sign is not tested for wrapping around
        own = abs(depth[i] - face[cell] - part * (face[cell + one] - face[cell]))
        own /= face_wide[cell] + part * (face_wide[cell + one] - face_wide[cell])
        own += face_log[cell] + part * (face_log[cell + one] - face_log[cell])
        other = abs(depth[i] - grooved[cell] - part * (grooved[cell + one] - grooved[cell]))
        other /= grooved_wide[cell] + part * (grooved_wide[cell + one] - grooved_wide[cell])
        other += grooved_log[cell] + part * (grooved_log[cell + one] - grooved_log[cell])
        in_gap = max(deep - depth[i], 0.0) / noise + log_gap
        total += min(min(own, other), min(log_stray, in_gap))
    return total


def moments(places: Array, cost: Array) -> tuple[float, float]:
    """Mean and standard deviation of the place, all being equally likely beforehand."""
    weight = np.exp(cost.min() - cost)
    weight /= weight.sum()
    mean = float(np.dot(weight, places))
    return mean, math.sqrt(float(np.dot(weight, (places - mean) ** 2)))


def thinned(samples: Samples, most: int) -> Samples:
    """At most so many samples as needed, by ascending v."""
    rows = spread_rows(len(samples.v), most)
    return rows_of(samples, rows[np.argsort(samples.v[rows], kind="stable")])


def rows_of(samples: Samples, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Samples:
    return replace(samples, v=samples.v[rows], depth=samples.depth[rows], x=samples.x[rows])
