"""Furniture of the demo house, each piece at its own corner. Millimetres."""

from __future__ import annotations

from .house_builder import Solid, box


def table(x: float, y: float, length: float, depth: float, height: float, style: str) -> list[Solid]:
    """A top on four legs; its corner at ``x``, ``y``."""
    legs = [(a, b) for a in (x + 40, x + length - 100) for b in (y + 40, y + depth - 100)]
    top = box(x, y, height - 40, length, depth, 40, style)
    return [top, *[box(a, b, 0, 60, 60, height - 40, style) for a, b in legs]]


def chair() -> list[Solid]:
    """With a seat and a back."""
    legs = [box(x, y, 0, 40, 40, 430, "timber") for x in (0, 410) for y in (0, 410)]
    return [*legs, box(0, 0, 430, 450, 450, 40, "fabric"), box(0, 0, 470, 450, 40, 430, "timber")]


def sofa() -> list[Solid]:
    """With two arms."""
    return [
        box(0, 0, 80, 2200, 900, 340, "fabric"), box(0, 0, 420, 2200, 220, 380, "fabric"),
        box(0, 220, 420, 200, 680, 180, "fabric"), box(2000, 220, 420, 200, 680, 180, "fabric"),
        *[box(x, y, 0, 60, 60, 80, "anthracite") for x in (40, 2100) for y in (40, 800)],
    ]


def counter() -> list[Solid]:
    """With a top and a plinth."""
    return [
        box(0, 0, 100, 3300, 600, 760, "white"), box(0, 0, 860, 3300, 630, 40, "anthracite"),
        box(50, 50, 0, 3200, 500, 100, "anthracite"),
    ]


def shelf() -> list[Solid]:
    """Open, with six boards."""
    boards = [box(30, 0, z, 940, 300, 30, "oak") for z in (0, 400, 800, 1200, 1600, 1970)]
    return [box(0, 0, 0, 30, 300, 2000, "oak"), box(970, 0, 0, 30, 300, 2000, "oak"), *boards]


def bed(width: float) -> list[Solid]:
    """With a headboard."""
    return [
        box(0, 0, 150, 2050, width, 180, "oak"), box(30, 30, 330, 1980, width - 60, 190, "white"),
        box(-40, 0, 0, 40, width, 950, "oak"),
        *[box(x, y, 0, 80, 80, 150, "oak") for x in (0, 1970) for y in (0, width - 80)],
    ]
