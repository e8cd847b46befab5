"""Why a part of the planned surface has no returns: the cause, seen from the station that came closest to seeing it.

For each query position and station, in this order: the ray that passes closest met something before the surface, or went
through it; or no ray came back from there: then something planned stands between, or the direction was not scanned, or
it was too far, or met too steeply; and where nothing of that holds, the surface itself sent nothing back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SEEN, PASSED, ABSORBED, GRAZING, OUT_OF_RANGE, OUTSIDE_VIEW, OCCLUDED, TURNED_AWAY, NO_STATION = range(9)
"""From ``PASSED`` on by how little would have to change for the station to see the surface."""
CAUSES: dict[int, str] = {
    PASSED: "seen through",
    ABSORBED: "absorbed",
    GRAZING: "too grazing",
    OUT_OF_RANGE: "out of range",
    OUTSIDE_VIEW: "outside the field of view",
    OCCLUDED: "occluded",
}
"""What a missing area is put down to; ``TURNED_AWAY`` (only the back is towards any station) counts as occluded: the
element's own body, or what stands before it, is in the way."""

Array = NDArray[np.float64]


@dataclass
class BestView:
    """Per query position (N,), of all stations looked at so far: the one that sees it, or came closest to it."""

    state: NDArray[np.int8]
    station: NDArray[np.int16]
    merit: Array
    """Received power of the view, relative: cos / distance^2; the better view among equal states."""
    blocker: Array
    """(N, 3) where the ray that was blocked ended, local frame; NaN where no return says so."""
    cosine: Array
    distance: Array

    @classmethod
    def empty(cls, count: int) -> BestView:
        return cls(
            np.full(count, NO_STATION, np.int8), np.full(count, -1, np.int16), np.full(count, -np.inf),
            np.full((count, 3), np.nan), np.full(count, np.nan), np.full(count, np.nan),
        )

    def offer(
        self, row: NDArray[np.int64], state: NDArray[np.int8], station: int, cosine: Array, distance: Array,
        blocker: Array,
    ) -> None:
        """Take this station's view of the rows where it is better than what is known."""
        merit = np.maximum(cosine, 1e-3) / np.maximum(distance, 1e-3) ** 2
        better = (state < self.state[row]) | ((state == self.state[row]) & (merit > self.merit[row]))
        at = row[better]
        self.state[at] = state[better]
        self.station[at] = station
        self.merit[at] = merit[better]
        self.blocker[at] = blocker[better]
        self.cosine[at] = cosine[better]
        self.distance[at] = distance[better]


@dataclass(frozen=True)
class Limits:
    """What the campaign's scanners could reach, as the returns show it."""

    range_max: float
    """Metres: no (or hardly any) return comes from farther."""
    elevation_min: float
    """Radians, sensor frame."""
    elevation_max: float
    faintest: float
    """Largest distance^2 / cos(incidence) [m2] that is mostly answered; infinite where no limit shows."""
    incidence_max: float
    """Radians, as asked for."""


def half_lost(tally: NDArray[np.int64], edges: Array, least: int = 60) -> float:
    """Where the share of answered views falls to one half for good, interpolated between the bins; infinite where it never
    does.

    tally (2, B): unanswered and answered views of the bins that begin at ``edges`` (B,), which grow by one factor; bins
    with fewer than ``least`` views say nothing.
    """
    total = tally.sum(axis=0)
    known = np.flatnonzero(total >= least)
    share = tally[1, known] / total[known]
    answered = np.flatnonzero(share >= 0.5)
    last = int(answered[-1]) if len(answered) else -1
    if last == len(known) - 1:
        return np.inf
    middle = edges[known] * math.sqrt(float(edges[1] / edges[0]))
    if last < 0:
        return float(edges[known[0]])
    part = (share[last] - 0.5) / (share[last] - share[last + 1])
    return float(middle[last] * (middle[last + 1] / middle[last]) ** part)
