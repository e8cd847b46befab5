"""What a classification found."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model.elements import BuildingModel
from ..scans.campaign import DropCount, ScanSource, Station


@dataclass(frozen=True)
class Classification:
    """The element of every return, in the order in which the source streams them."""

    model: BuildingModel
    source: ScanSource
    """In the model's frame; read again when the cloud is written."""
    element: NDArray[np.int32]
    """(N,) rows of ``model.elements``; -1 for returns that lie on none."""
    deviation: NDArray[np.float32]
    """(N,) metres from the element's surface along its outward normal; NaN where there is no element."""
    counts: NDArray[np.int64]
    """(E + 1, S) returns of each element and station; the last row is what lies on no element."""
    mean: NDArray[np.float64]
    """(E,) metres, mean deviation; NaN without returns."""
    spread: NDArray[np.float64]
    """(E,) metres, standard deviation of the deviations."""
    reach: float
    """Metres along the normal within which a return belongs to a surface."""
    registration_sigma: float
    moved: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """GlobalId -> shift [m] of the elements that were looked for where a verification found them."""
    absent: tuple[str, ...] = ()
    """GlobalIds of the elements that a verification found absent: nothing was assigned to them."""
    timings: dict[str, float] = field(default_factory=dict)
    dropped: DropCount = field(default_factory=DropCount)
    """Points of the scans that are no returns."""

    @property
    def stations(self) -> tuple[Station, ...]:
        return self.source.stations

    def summary(self) -> str:
        """One line."""
        total, rest = int(self.counts.sum()), int(self.counts[-1].sum())
        found = int((self.counts[:-1].sum(axis=1) > 0).sum())
        share = (total - rest) / total if total else 0.0
        return (
            f"{total:,} returns: {share:.1%} on {found} of {len(self.model.elements)} elements, {rest:,} on none "
            f"(within {1000 * self.reach:.0f} mm along the normal)."
        )


def classification_to_json(result: Classification) -> dict[str, Any]:
    """What ``--json`` writes: lengths in metres."""
    per_element = result.counts.sum(axis=1)

    def length(value: float) -> float | None:
        return round(float(value), 6) if np.isfinite(value) else None

    return {
        "model": result.model.path,
        "scans": list(result.source.paths),
        "returns": int(per_element.sum()),
        "unassigned": int(per_element[-1]),
        "dropped": asdict(result.dropped),
        "reach": result.reach,
        "registration_sigma": result.registration_sigma,
        "stations": [
            {"name": s.name, "position": [float(v) for v in s.position], "returns": int(n), "unassigned": int(rest)}
            for s, n, rest in zip(result.stations, result.counts.sum(axis=0), result.counts[-1], strict=True)
        ],
        "elements": [
            {
                "global_id": e.global_id, "class": e.ifc_class, "name": e.name, "storey": e.storey,
                "returns": int(per_element[row]), "per_station": [int(n) for n in result.counts[row]],
                "deviation_mean": length(result.mean[row]), "deviation_sigma": length(result.spread[row]),
                **({"moved": [round(v, 6) for v in result.moved[e.global_id]]} if e.global_id in result.moved else {}),
                **({"absent": True} if e.global_id in result.absent else {}),
            }
            for row, e in enumerate(result.model.elements)
        ],
        "timings": result.timings,
    }
