"""A plan in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from .results import ElementForecast, PlanResult

MOST_NAMED = 5
KINDS = {
    "IfcWall": "walls", "IfcWallStandardCase": "walls", "IfcSlab": "slabs", "IfcColumn": "columns", "IfcBeam": "beams",
    "IfcDoor": "doors", "IfcWindow": "windows", "IfcMember": "members", "IfcRoof": "roofs", "IfcStair": "stairs",
    "IfcRailing": "railings", "IfcCovering": "coverings", "IfcFurniture": "pieces of furniture",
}


def plan_sentence(result: PlanResult) -> str:
    """How many set-ups give the level on which elements, and whether fewer could."""
    count, asked = len(result.stations), result.asked
    gained = [f for f in asked if f.reached_by > 0]
    more = " more" if result.existing else ""
    here = f", {result.minutes:.0f} min with the {result.scanner.name} scanner,"
    if result.existing:
        on = f"{_kind(gained)}: {named(gained)}" if gained else "no further element as a whole"
        before = len(result.completed(0))
        which = f"on {on}. The campaign gives it on {before} of {len(asked)} already" if before else f"on {on}"
    else:
        which = f"on {len(gained)} of {len(asked)} elements"
    short = [f for f in asked if f.reached_by < 0]
    lacking = f" Not reached: {named(short)}." if short else ""
    least = "No plan over the places looked at has fewer." if result.optimal else f"At least {result.least} are needed."
    return (
        f"{count}{more} set-up{'s' if count != 1 else ''}{here} give{'s' if count == 1 else ''} LOA{result.options.loa} "
        f"{which}.{lacking} {least}"
    )


def named(elements: Sequence[ElementForecast]) -> str:
    """The first few by name, and how many more."""
    names = [f"{f.ifc_class} {f.name}".strip() for f in elements[:MOST_NAMED]]
    more = len(elements) - len(names)
    return ", ".join(names) + (f" and {more} more" if more else "")


def _kind(elements: Sequence[ElementForecast]) -> str:
    """``these 5 walls``, or ``these 5 elements`` where they are of several classes."""
    kinds = Counter(KINDS.get(f.ifc_class, "elements") for f in elements)
    kind = next(iter(kinds)) if len(kinds) == 1 else "elements"
    return "this element" if len(elements) == 1 else f"these {len(elements)} {kind}"
