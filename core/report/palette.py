"""The one place of colours. All colours are sRGB, 0..1; ``to_linear`` makes what Blender's float colours want.

The five statuses differ in lightness as well as in hue, so they stay apart for the three colour vision deficiencies and
in a grey print; wherever they are shown, a text or a sign says the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..results import STATUSES, Status

RGB = tuple[float, float, float]


def rgb(code: str) -> RGB:
    """``#rrggbb`` to sRGB 0..1."""
    return (int(code[1:3], 16) / 255.0, int(code[3:5], 16) / 255.0, int(code[5:7], 16) / 255.0)


STATUS_HEX: dict[Status, str] = {
    "CONFIRMED": "#0b8a66",
    "DEVIATING": "#f2a900",
    "ABSENT": "#b4123c",
    "PARTIAL": "#6cb6f0",
    "NOTOBSERVED": "#9aa2af",
}
STATUS_COLORS: dict[str, RGB] = {status: rgb(STATUS_HEX[status]) for status in STATUSES}
"""sRGB 0..1 per status."""
STATUS_SIGNS: dict[Status, str] = {
    "CONFIRMED": "✓", "DEVIATING": "↔", "ABSENT": "✕", "PARTIAL": "◐", "NOTOBSERVED": "?",
}
STATUS_LABELS: dict[Status, str] = {
    "CONFIRMED": "Confirmed", "DEVIATING": "Deviating", "ABSENT": "Absent", "PARTIAL": "Partial",
    "NOTOBSERVED": "Not observed",
}
STATUS_MEANINGS: dict[Status, str] = {
    "CONFIRMED": "built as planned, within the level asked for",
    "DEVIATING": "built, but outside the level asked for",
    "ABSENT": "rays passed through its place",
    "PARTIAL": "seen in part, too little to decide on the whole",
    "NOTOBSERVED": "no ray reached it, so nothing is known",
}

BELIEF_HEX = {"occupied": "#0b8a66", "empty": "#b4123c", "unknown": "#94a0b4"}
BELIEF_COLORS: dict[str, RGB] = {name: rgb(code) for name, code in BELIEF_HEX.items()}
"""Occupied green, empty red, unknown blue-grey."""

CHANGE_HEX = {
    "CONFIRMED": "#0b8a66", "NEW": "#f2c400", "DISAPPEARED": "#b4123c", "PARTIAL": "#e0762a", "UNKNOWN": "#4a78c8",
}
"""States of a comparison: confirmed green, new yellow, disappeared red, unknown blue."""
CHANGE_COLORS: dict[str, RGB] = {state: rgb(code) for state, code in CHANGE_HEX.items()}
CHANGE_MEANINGS = {
    "CONFIRMED": "stands where it stood",
    "NEW": "stands where nothing stood",
    "DISAPPEARED": "rays pass through its place",
    "PARTIAL": "a part is gone, or it moved",
    "UNKNOWN": "not seen, or not told apart",
}
VOXEL_COLORS = np.array([CHANGE_COLORS[state] for state in ("UNKNOWN", "CONFIRMED", "NEW", "DISAPPEARED")])
"""(4, 3) by the state of a voxel."""

DEVIATION_STOPS = (
    "#0a468c", "#2a76ba", "#5fa5d4", "#b0d3e8", "#ebebe6", "#f3c39e", "#e2864f", "#c4531f", "#9a3208",
)  # fmt: skip
"""Equally spaced from minus to plus the limit: blue behind the planned surface, orange-brown in front of it."""
UNMEASURED: RGB = rgb("#6e6e6e")
"""Where nothing is known: a neutral grey, since a bluish one would pass for a small negative deviation."""


def deviation_color(values_m: ArrayLike, limit_m: float) -> NDArray[np.float64]:
    """(N,) signed deviations [m] to (N, 3) colours, full at ``limit_m`` and beyond; UNMEASURED where not finite."""
    return ramp_color(values_m, -limit_m, limit_m, DEVIATION_STOPS)


def ramp_color(values: ArrayLike, low: float, high: float, stops: Sequence[str]) -> NDArray[np.float64]:
    """(N,) numbers to (N, 3) colours on ``stops`` (``#rrggbb``), spread evenly from ``low`` to ``high``; else UNMEASURED."""
    number = np.asarray(values, dtype=np.float64).reshape(-1)
    known = np.isfinite(number)
    scale = np.array([rgb(code) for code in stops])
    at = np.clip((np.where(known, number, low) - low) / (high - low), 0.0, 1.0)
    place = np.linspace(0.0, 1.0, len(scale))
    color = np.stack([np.interp(at, place, scale[:, channel]) for channel in range(3)], axis=1)
    color[~known] = UNMEASURED
    return color


def belief_color(occupied: ArrayLike, empty: ArrayLike, unknown: ArrayLike) -> NDArray[np.float64]:
    """Three (N,) masses to (N, 3) colours: the three belief colours mixed in proportion; unknown where not finite."""
    mass = np.stack([np.asarray(m, dtype=np.float64).reshape(-1) for m in (occupied, empty, unknown)], axis=1)
    mass = np.where(np.isfinite(mass).all(axis=1, keepdims=True), np.clip(mass, 0.0, None), [0.0, 0.0, 1.0])
    total = mass.sum(axis=1, keepdims=True)
    mass = np.where(total > 0, mass / np.where(total > 0, total, 1.0), [0.0, 0.0, 1.0])
    return mass @ np.array([BELIEF_COLORS["occupied"], BELIEF_COLORS["empty"], BELIEF_COLORS["unknown"]])


def status_color(statuses: ArrayLike) -> NDArray[np.float64]:
    """(N,) status names to (N, 3) colours."""
    return np.array([STATUS_COLORS[str(s)] for s in np.asarray(statuses)]).reshape(-1, 3)


def to_linear(srgb: ArrayLike) -> NDArray[np.float64]:
    """sRGB 0..1 to linear light 0..1 (IEC 61966-2-1), any shape."""
    c = np.asarray(srgb, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0.0) + 0.055) / 1.055) ** 2.4)


def from_linear(linear: ArrayLike) -> NDArray[np.float64]:
    """Linear light 0..1 to sRGB 0..1, any shape."""
    c = np.asarray(linear, dtype=np.float64)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 0.0) ** (1 / 2.4) - 0.055)


def to_bytes(srgb: ArrayLike) -> NDArray[np.uint8]:
    """sRGB 0..1 to 0..255, rounded."""
    return np.rint(np.clip(np.asarray(srgb, dtype=np.float64), 0.0, 1.0) * 255.0).astype(np.uint8)
