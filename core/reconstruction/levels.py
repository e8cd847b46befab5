"""Storeys of a scanned building: a scanner stands on a floor, under a ceiling."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..planes.surfels import Surfels

Array = NDArray[np.float64]

LEVEL_COS = 0.95
BIN_M = 0.02
AROUND_M = 5.0
"""Surfaces this far (in plan) from a station decide what it stands on."""
BELOW_M = (0.3, 2.6)
"""Height of a scanner above its floor."""
ABOVE_M = (0.15, 12.0)
LEAST_AREA_M2 = 0.5
SHARE_OF_LARGEST = 0.25
"""A level counts as floor when it shows this share of the largest level's area: tables show less."""
STOREYS_APART_M = 1.2
UNDER_FLOOR_M = 0.03
SAME_FLOOR_M = 0.05
OVER_M = 1.0
"""So far about a station (in plan) is what is right over it."""
PAST_M = 0.3
"""A room reaches past the next storey's floor when its ceiling is so much higher."""


@dataclass(frozen=True)
class Storey:
    """Heights in the local frame, metres."""

    floor: float
    ceiling: float
    """The level that shows most area; rooms may have their own."""
    has_ceiling: bool
    top: float
    """Nothing above this belongs to the storey: the next floor, or the highest return."""
    stations: tuple[int, ...]
    past: float = np.inf
    """Floor of the next storey, where rooms of this one reach past it: it ends them only where that floor is."""
    beside: bool = False
    """Rooms of the storey below reach past this floor, so it does not lie everywhere."""

    def closed(self) -> Storey:
        """The same if none of its rooms reaches past the next floor."""
        return replace(self, top=self.past - UNDER_FLOOR_M, past=np.inf)


def find_storeys(surfels: Surfels, stations: Array) -> list[Storey]:
    """Storeys from the lowest up; empty when no station stands on a floor."""
    flat = surfels.where(np.abs(surfels.normal[:, 2]) > LEVEL_COS)
    up, down = flat.where(flat.normal[:, 2] > 0), flat.where(flat.normal[:, 2] < 0)
    stands = []
    for index, place in enumerate(stations):
        floor = _level(up, place, -BELOW_M[1], -BELOW_M[0], lowest=True)
        if floor is not None:
            stands.append((floor, index))
    covered = [s for s in stands if _level(down, stations[s[1]], *ABOVE_M, lowest=False) is not None]
    groups: list[list[tuple[float, int]]] = []
    for stand in sorted(covered or stands):
        if groups and stand[0] - groups[-1][-1][0] < STOREYS_APART_M:
            groups[-1].append(stand)
        else:
            groups.append([stand])
    floors = [_floor(up, down, group, stations) for group in groups]
    highest = float(surfels.position[:, 2].max()) if len(surfels) else 0.0
    out: list[Storey] = []
    for k, group in enumerate(groups):
        own = tuple(index for _, index in group)
        above = floors[k + 1] if k + 1 < len(groups) else np.inf
        through = [height for index in own if (height := _over(up, down, stations[index], above)) is not None]
        limit = min((f for f in floors if f > max(through, default=floors[k])), default=np.inf)
        ceilings = [_ceiling(down, stations[index], above) for index in own]
        seen = [height for height in ceilings if height is not None] or through
        top = limit - UNDER_FLOOR_M if np.isfinite(limit) else highest
        ceiling = float(np.median(seen)) if seen else top
        beside = bool(out) and np.isfinite(out[-1].past)
        out.append(Storey(floors[k], ceiling, bool(seen), top, own, above if through else np.inf, beside))
    return out


def _floor(up: Surfels, down: Surfels, group: list[tuple[float, int]], stations: Array) -> float:
    """Of the floors of stations that something is right over the one with most area: a terrace or a balcony lies lower."""
    inside = [f for f, index in group if _level(down, stations[index], *ABOVE_M, lowest=True, around=OVER_M) is not None]
    candidates = np.array(inside or [f for f, _ in group])
    z = up.position[:, 2]
    best = max(candidates, key=lambda f: float(up.area[np.abs(z - f) < 2 * BIN_M].sum()))
    return float(np.median(candidates[np.abs(candidates - best) < SAME_FLOOR_M]))


def _ceiling(down: Surfels, place: Array, above: float) -> float | None:
    """The largest level over a station and below the floor ``above``: a stair's opening shows that storey's ceiling as well."""
    return _level(down, place, ABOVE_M[0], min(ABOVE_M[1], above - place[2]), lowest=False)


def _over(up: Surfels, down: Surfels, place: Array, above: float) -> float | None:
    """What is right over a station if that is past the floor ``above``, and that floor is not."""
    height = _level(down, place, *ABOVE_M, lowest=True, around=OVER_M)
    if height is None or height < above + PAST_M:
        return None
    on_floor = (np.abs(up.position[:, 2] - above) < PAST_M) & (np.hypot(*(up.position[:, :2] - place[:2]).T) < OVER_M)
    return None if up.area[on_floor].sum() > LEAST_AREA_M2 else height


def _level(
    flat: Surfels, place: Array, low: float, high: float, *, lowest: bool, around: float = AROUND_M
) -> float | None:
    """Height of the largest level (or the lowest one nearly as large) between two heights above ``place``."""
    z = flat.position[:, 2] - place[2]
    near = (z > low) & (z < high) & (np.hypot(*(flat.position[:, :2] - place[:2]).T) < around)
    if flat.area[near].sum() < LEAST_AREA_M2:
        return None
    height, area = flat.position[near, 2], flat.area[near]
    base = height.min()
    histogram = np.bincount(((height - base) / BIN_M).astype(np.int64), area)
    smooth = np.convolve(np.pad(histogram, 2), np.ones(3), mode="same")
    if smooth.max() < LEAST_AREA_M2:
        return None
    large = np.flatnonzero(smooth >= SHARE_OF_LARGEST * smooth.max())
    peak = int(large[0]) if lowest else int(np.argmax(smooth))
    if lowest:
        nearby = np.arange(peak, min(peak + 4, len(smooth)))
        peak = int(nearby[np.argmax(smooth[nearby])])
    centre = base + (peak - 2 + 0.5) * BIN_M
    own = np.abs(height - centre) < 2 * BIN_M
    return float(np.median(height[own])) if own.any() else float(centre)
