"""What colours may say. A ``Mode`` is one way to colour, with the legend that explains it; capabilities bring them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.report import palette

Swatch = tuple[str, palette.RGB]

SEQUENTIAL_STOPS = ("#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725")
"""viridis: even steps of lightness, the same order for all colour vision deficiencies and in grey."""

FACTORS = {"mm": 1000.0, "%": 100.0}
"""From SI units, or shares, to the unit of a legend."""


@dataclass(frozen=True)
class Surface:
    """One element's object while it is coloured."""

    item: bpy.types.Object

    def __len__(self) -> int:
        return len(self.item.data.vertices)

    def __call__(self, attribute: str) -> NDArray[np.float32]:
        """(V,) values of a FLOAT attribute of the vertices; not-a-number where the mesh does not have it."""
        values = np.full(len(self), np.nan, dtype=np.float32)
        if attribute in self.item.data.attributes:
            self.item.data.attributes[attribute].data.foreach_get("value", values)
        return values


@dataclass(frozen=True)
class Ramp:
    """A scale of colours in a legend."""

    colors: tuple[palette.RGB, ...]
    """Equally spaced, from low to high; sRGB."""
    ticks: tuple[tuple[float, str], ...]
    """(place 0..1, text with unit)."""


@dataclass(frozen=True)
class Legend:
    """What the colours mean: swatches, a ramp, or both."""

    swatches: tuple[Swatch, ...] = ()
    ramp: Ramp | None = None


@dataclass(frozen=True)
class Category:
    """One of the classes that a categorical mode tells apart."""

    identifier: str
    label: str
    meaning: str
    color: palette.RGB


@dataclass(frozen=True)
class Mode:
    """One way to colour."""

    identifier: str
    label: str
    description: str
    color: Callable[[Surface, bpy.types.Scene], NDArray[np.float64]]
    """(V, 3) or (3,) sRGB."""
    legend: Callable[[bpy.types.Scene], Legend]
    known: Callable[[bpy.types.Object], bool]
    """Whether there is anything to show on this element; else it is grey."""
    category: Callable[[bpy.types.Object], str] | None = None
    """The element's class; empty where it has none. Such modes fill the finding list."""
    categories: tuple[Category, ...] = ()


def categorical(
    identifier: str,
    label: str,
    description: str,
    categories: tuple[Category, ...],
    category: Callable[[bpy.types.Object], str],
) -> Mode:
    """A mode with one colour a class; ``category`` gives the class of an element, empty where it has none."""
    color = {entry.identifier: np.array(entry.color) for entry in categories}
    return Mode(
        identifier,
        label,
        description,
        lambda surface, _: color.get(category(surface.item), np.array(palette.UNMEASURED)),
        lambda _: Legend(tuple((entry.label, entry.color) for entry in categories)),
        lambda item: bool(category(item)),
        category,
        categories,
    )


def ramp(
    identifier: str,
    label: str,
    description: str,
    values: str | Callable[[Surface], NDArray[np.float32]],
    *,
    unit: str,
    span: Callable[[bpy.types.Scene], tuple[float, float]] = lambda _: (0.0, 1.0),
    stops: tuple[str, ...] = SEQUENTIAL_STOPS,
    nothing: str = "",
    known: Callable[[bpy.types.Object], bool] = lambda item: bool(item.bim_verify.status),
) -> Mode:
    """A mode that colours a number on a scale.

    ``values``: the name of a vertex attribute, or a function giving (V,) numbers in SI units (shares 0..1).
    ``unit``: of the legend, ``mm`` (values are metres), ``m`` or ``%`` (values are shares). ``span``: scene -> lowest and
    highest value of the scale, beyond which the colour stays. ``nothing``: legend text of not-a-number, if there may be any.
    """

    def color(surface: Surface, scene: bpy.types.Scene) -> NDArray[np.float64]:
        low, high = span(scene)
        value = surface(values) if isinstance(values, str) else values(surface)
        return palette.ramp_color(value, low, high, stops)

    def legend(scene: bpy.types.Scene) -> Legend:
        swatches = ((nothing, palette.UNMEASURED),) if nothing else ()
        return Legend(swatches, scale_of(*span(scene), unit=unit, stops=stops))

    return Mode(identifier, label, description, color, legend, known)


def scale_of(low: float, high: float, *, unit: str, stops: tuple[str, ...]) -> Ramp:
    """The scale from ``low`` to ``high`` (SI units, shares 0..1), its ticks in ``unit``: ``mm``, ``m`` or ``%``."""
    factor, signed = FACTORS.get(unit, 1.0), "+" if low < 0 else ""
    places = np.linspace(0.0, 1.0, 5)
    at = low + places * (high - low)
    ticks = tuple((float(p), f"{_number(factor * v, signed)} {unit}") for p, v in zip(places, at, strict=True))
    return Ramp(tuple(palette.rgb(code) for code in stops), ticks)


STATION_COLORS = np.array([
    (0.35, 0.55, 0.75), (0.80, 0.60, 0.35), (0.45, 0.65, 0.45),
    (0.70, 0.50, 0.65), (0.65, 0.65, 0.40), (0.40, 0.65, 0.65),
])  # fmt: skip
"""Muted, so that they are not taken for a verdict; stations beyond the last start over."""


def scan_color(color: NDArray[np.uint8] | None, station: NDArray[np.int32]) -> NDArray[np.float64]:
    """(N, 3) linear colours of scan points: the file's own, or one per station where it has none."""
    srgb = STATION_COLORS[station % len(STATION_COLORS)] if color is None else color / 255.0
    return palette.to_linear(srgb)


def _number(value: float, signed: str) -> str:
    text = f"{value:{signed}.1f}".removesuffix(".0")
    return "0" if text in ("+0", "-0") else text
