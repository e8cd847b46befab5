"""What a plan is: stations in order, what they are expected to give, and how far it is from the best."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..model.elements import BuildingModel
from ..simulation.scanner import Scanner
from .options import PlanOptions

REACHED = 1e-6
"""Share by which a coverage may miss its target: sums round."""


@dataclass(frozen=True)
class PlanStation:
    """One set-up to make. Metres, model frame."""

    name: str
    position: tuple[float, float, float]
    """Of the scanner's centre."""
    floor: float | None
    minutes: float
    """Set-up and scan."""
    area: float
    """m2 that it measures well enough."""
    new_area: float
    """Of that, what no station before it does."""
    linked_to: tuple[str, ...]
    """Stations whose views overlap enough to register it by."""
    actions: tuple[str, ...] = ()
    """Of AO, RA, RD, IN, IR, in a plan that mends an existing campaign."""
    for_elements: tuple[str, ...] = ()
    """GlobalIds of the elements of which it measures something that no station before it does."""


@dataclass(frozen=True)
class ElementForecast:
    """What the plan is expected to give for one element, before anyone scans."""

    global_id: str
    ifc_class: str
    name: str
    chosen: bool
    """Whether the plan had to cover it."""
    reachable: float
    """Share of its exposed surface that some place measures as required."""
    target: float
    """Share that the plan had to cover: the coverage asked for, times ``reachable``."""
    coverage: float
    """Share of its exposed surface expected to be measured as required."""
    before: float
    """Of that, what an existing campaign measures already."""
    reached_by: int
    """The set-up (1, 2, ...) with which it reaches its target; 0 before any, -1 never."""
    belief: float
    """Expected mean belief that it is occupied, if it stands as planned."""
    spacing: float | None
    sigma: float | None
    """Of a measured position along the normal, of the best view."""
    predicted_error: float | None
    loa: int | None


@dataclass(frozen=True)
class PlanResult:
    """Everything that a planning found."""

    model: BuildingModel
    options: PlanOptions
    scanner: Scanner
    stations: tuple[PlanStation, ...]
    existing: tuple[str, ...]
    """Names of the stations of the campaign that the plan adds to."""
    forecasts: tuple[ElementForecast, ...]
    """One per ``model.elements``, same order."""
    least: int
    """No plan over the places looked at has fewer (new) stations."""
    optimal: bool
    places: int
    heuristic: int
    """Stations of the heuristic alone."""
    method: str
    timings: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def gap(self) -> float:
        """Share by which the plan may be larger than the best one."""
        return (len(self.stations) - self.least) / max(len(self.stations), 1)

    @property
    def minutes(self) -> float:
        """Set-ups and scans together."""
        return sum(s.minutes for s in self.stations)

    @property
    def asked(self) -> list[ElementForecast]:
        """The elements that the plan had to cover."""
        return [f for f in self.forecasts if f.chosen and f.target > 0]

    def completed(self, number: int) -> list[ElementForecast]:
        """The elements that reach their target with set-up ``number`` (1, 2, ...); 0: with the existing campaign."""
        return [f for f in self.asked if f.reached_by == number]

    def summary(self) -> dict[str, Any]:
        """The few numbers of the whole."""
        asked = self.asked
        return {
            "stations": len(self.stations),
            "existing_stations": len(self.existing),
            "least_possible": self.least,
            "optimal": self.optimal,
            "gap": self.gap,
            "minutes": self.minutes,
            "loa": self.options.loa,
            "scanner": self.scanner.name,
            "elements_asked": len(asked),
            "elements_reached": sum(f.reached_by >= 0 for f in asked),
            "elements_reached_before": len(self.completed(0)),
            "elements_out_of_reach": sum(f.chosen and f.target <= 0 for f in self.forecasts),
        }
