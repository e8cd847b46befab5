"""Facades that never stood: a seed to a street front with known windows and doors, in several styles.

Frame: x along the wall from left to right as seen from the street, z up from the pavement, metres.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

Kind = Literal["window", "door"]
Style = Literal["grid", "arched", "ribbon", "vertical", "mixed", "shop"]
STYLES: tuple[Style, ...] = ("grid", "arched", "ribbon", "vertical", "mixed", "shop")
FINISHES = ("plaster", "brick", "stone", "concrete")


@dataclass(frozen=True)
class ElementType:
    """What the elements of one group have in common; lengths in metres."""

    kind: Kind
    width: float
    height: float
    rise: float = 0.0
    """Of the arch above the springing line; 0: rectangular, half the width: a half circle."""
    casements: int = 2
    transom: float = 0.0
    """Height of the part above the cross bar; 0: none."""
    railing: bool = False
    glazed: bool = True
    surround: float = 0.0
    """Width of the flat frame of stone around the opening."""


@dataclass(frozen=True)
class FacadeElement:
    """One opening: its left lower corner and its type (row of ``FacadePlan.types``)."""

    x: float
    z: float
    type: int


@dataclass(frozen=True)
class FacadePlan:
    """A street front, rectangular, with its openings."""

    seed: int
    style: Style
    width: float
    height: float
    levels: tuple[float, ...]
    """Of the floors, the lowest first (0)."""
    types: tuple[ElementType, ...]
    elements: tuple[FacadeElement, ...]
    finish: str
    base_finish: str
    """Of the ground floor."""
    courses: tuple[float, ...] = ()
    """Heights of the string courses."""
    cornice: bool = True
    sills: bool = True

    def box(self, element: FacadeElement) -> tuple[float, float, float, float]:
        """x0, z0, x1, z1."""
        kind = self.types[element.type]
        return element.x, element.z, element.x + kind.width, element.z + kind.height


@dataclass
class _Draft:
    rng: np.random.Generator
    types: list[ElementType] = field(default_factory=list)
    elements: list[FacadeElement] = field(default_factory=list)

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def type(self, *args: object, **kwargs: object) -> int:
        self.types.append(ElementType(*args, **kwargs))  # type: ignore[arg-type]
        return len(self.types) - 1

    def row(self, centers: list[float], kinds: list[int], sill: float) -> None:
        for middle, kind in zip(centers, kinds, strict=True):
            made = self.types[kind]
            base = sill if made.kind == "window" else 0.0
            self.elements.append(FacadeElement(middle - made.width / 2, base, kind))


def facade_plan(seed: int) -> FacadePlan:
    """The facade of a seed; two neighbouring seeds (even, odd) share the style and nothing else."""
    rng = np.random.default_rng((seed, 31))
    style = STYLES[(seed // 2) % len(STYLES)]
    d = _Draft(rng)
    floors = int(rng.integers(2, 6))
    storey = d.between(2.8, 3.7)
    ground = storey + d.between(0.0, 0.7)
    levels = (0.0, *(ground + storey * k for k in range(floors - 1)))
    height = ground + storey * (floors - 1) + d.between(0.3, 0.9)
    width = {"ribbon": _ribbon, "vertical": _vertical}.get(style, _bays)(d, style, levels, storey, ground)
    finish = str(rng.choice(FINISHES, p=[0.4, 0.25, 0.2, 0.15]))
    base = str(rng.choice(["plaster", "stone"])) if finish != "concrete" and d.chance(0.35) else finish
    courses = tuple(level - 0.15 for level in levels[1:] if style in ("arched", "mixed", "grid") and d.chance(0.35))
    return FacadePlan(
        seed,
        style,
        width,
        height,
        levels,
        tuple(d.types),
        tuple(d.elements),
        finish,
        base,
        courses,
        d.chance(0.7),
        style not in ("vertical", "shop") or d.chance(0.5),
    )


def _door(d: _Draft, rise: bool = False, surround: float = 0.0) -> int:
    wide = d.between(1.0, 1.7)
    high = d.between(2.1, 2.5) + (0.5 * wide if rise else d.between(0.0, 0.4))
    return d.type(
        "door",
        wide,
        high,
        0.5 * wide if rise else 0.0,
        2 if wide > 1.3 else 1,
        0.0 if rise else d.between(0.0, 0.45),
        False,
        d.chance(0.3),
        surround,
    )


def _bays(d: _Draft, style: Style, levels: tuple[float, ...], storey: float, ground: float) -> float:
    """Windows apart from each other, above each other."""
    bays = int(d.rng.integers(3, 8))
    surround = d.between(0.1, 0.18) if d.chance(0.5 if style != "arched" else 0.8) else 0.0
    wide = d.between(0.9, 1.6)
    tall = min(d.between(1.2, 2.0), storey - 1.25)
    sill = d.between(0.75, 0.95)
    pitch = wide + d.between(0.9, 1.9) + 2 * surround
    casements, transom = int(d.rng.integers(1, 4)), d.between(0.3, 0.5) if d.chance(0.4) else 0.0
    common = d.type("window", wide, tall, 0.0, casements, transom, False, True, surround)
    margin = d.between(0.8, 1.6)
    pattern = [common] * bays
    if style == "mixed":
        other = d.type("window", wide * d.between(0.5, 0.7), tall, 0.0, 1, transom, False, True, surround)
        pattern = [other if k % 2 else common for k in range(bays)]
    centers = [margin + pitch * (k + 0.5) for k in range(bays)]
    width = 2 * margin + pitch * bays
    arched = style == "arched"
    for floor, level in enumerate(levels[1:], start=1):
        kinds, foot = list(pattern), sill
        if arched and d.chance(0.5):
            rise = 0.5 * wide if d.chance(0.6) else 0.2 * wide
            kinds = [d.type("window", wide, tall + 0.5 * rise, rise, casements, 0.0, False, True, surround)] * bays
        elif style == "mixed" and floor == 1 and d.chance(0.7):
            # reach down to the floor, behind railings
            kinds = [d.type("window", wide, min(sill + tall, storey - 0.45), 0.0, 2, 0.0, True, True, surround)] * bays
            foot = 0.08
        elif style == "mixed" and floor == len(levels) - 1 and d.chance(0.6):
            kinds = [d.type("window", wide, 0.65 * tall, 0.0, casements, 0.0, False, True, surround)] * bays
        before = len(d.elements)
        d.row(centers, kinds, foot)
        _lift(d, before, level)
    if style == "shop":
        _shop(d, width, ground)
        return width
    kinds = [common] * bays
    low = sill + d.between(0.0, 0.3)
    if arched:
        rise = 0.5 * wide
        tall = min(tall + rise, ground - low - 0.45)
        kinds = [d.type("window", wide, tall, rise, casements, 0.0, False, True, surround)] * bays
    elif style == "mixed":
        kinds = list(pattern)
    door = _door(d, arched, surround)
    for k in {int(d.rng.integers(0, bays)), int(d.rng.integers(0, bays)) if d.chance(0.3) else bays // 2}:
        kinds[k] = door
    d.row(centers, kinds, low)
    return width


def _shop(d: _Draft, width: float, ground: float) -> None:
    """Large panes and glazed doors to the street."""
    high = min(d.between(2.3, 2.8), ground - 0.6)
    count = max(2, int(width / d.between(2.8, 4.2)))
    pier = d.between(0.5, 0.9)
    wide = (width - pier * (count + 1)) / count
    foot = d.between(0.3, 0.6)
    pane = d.type("window", wide, high - foot, 0.0, max(1, int(wide / 1.3)), 0.0)
    door = _door(d)
    entry = int(d.rng.integers(0, count))
    for k in range(count):
        x = pier + k * (wide + pier)
        if k == entry and wide > d.types[door].width + 0.2:
            d.elements.append(FacadeElement(x + (wide - d.types[door].width) / 2, 0.0, door))
        else:
            d.elements.append(FacadeElement(x, foot, pane))


def _ribbon(d: _Draft, style: Style, levels: tuple[float, ...], storey: float, ground: float) -> float:
    """Windows in bands, next to each other along a floor."""
    modules = int(d.rng.integers(4, 10))
    wide, divider, margin = d.between(1.2, 2.2), d.between(0.15, 0.4), d.between(0.3, 1.2)
    sill = d.between(0.75, 1.0)
    tall = min(d.between(1.3, 2.0), storey - sill - 0.35)
    window = d.type("window", wide, tall, 0.0, int(d.rng.integers(1, 3)), 0.0)
    centers = [margin + (wide + divider) * k + wide / 2 for k in range(modules)]
    for level in levels[1:]:
        before = len(d.elements)
        d.row(centers, [window] * modules, sill)
        _lift(d, before, level)
    door = _door(d)
    kinds = [window] * modules
    kinds[int(d.rng.integers(0, modules))] = door
    d.row(centers, kinds, sill)
    return 2 * margin + modules * wide + (modules - 1) * divider


def _vertical(d: _Draft, style: Style, levels: tuple[float, ...], storey: float, ground: float) -> float:
    """Windows in strips, next to each other up the facade."""
    bays = int(d.rng.integers(3, 7))
    wide, pier, divider = d.between(1.1, 2.4), d.between(0.7, 1.6), d.between(0.15, 0.4)
    window = d.type(
        "window", wide, storey - divider, 0.0, int(d.rng.integers(1, 3)), d.between(0.5, 0.8) if d.chance(0.5) else 0.0
    )
    low = d.type("window", wide, ground - divider - 0.6, 0.0, d.types[window].casements, 0.0)
    centers = [pier + (wide + pier) * k + wide / 2 for k in range(bays)]
    for level in levels[1:]:
        before = len(d.elements)
        d.row(centers, [window] * bays, 0.0)
        _lift(d, before, level)
    kinds = [low] * bays
    kinds[int(d.rng.integers(0, bays))] = _door(d)
    d.row(centers, kinds, 0.6)
    return pier + bays * (wide + pier)


def _lift(d: _Draft, first: int, level: float) -> None:
    d.elements[first:] = [FacadeElement(e.x, e.z + level, e.type) for e in d.elements[first:]]
