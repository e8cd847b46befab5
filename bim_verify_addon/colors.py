"""What colours may say. One entry a mode: how vertices are coloured, and the legend that explains it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.report import palette

LOA_COLORS: dict[str, palette.RGB] = {
    "LOA50": (0.00, 0.27, 0.35),
    "LOA40": (0.00, 0.42, 0.46),
    "LOA30": (0.21, 0.60, 0.51),
    "LOA20": (0.55, 0.77, 0.50),
    "LOA10": (0.93, 0.87, 0.47),
    "NONE": (0.71, 0.07, 0.24),
}


@dataclass(frozen=True)
class Surface:
    """What is known on the vertices of one element."""

    status: str
    achieved_loa: str
    occupied: NDArray[np.float32]
    empty: NDArray[np.float32]
    unknown: NDArray[np.float32]
    deviation: NDArray[np.float32]
    """Metres; NaN where not measured."""


Swatch = tuple[str, palette.RGB]


@dataclass(frozen=True)
class Mode:
    """One way to colour."""

    identifier: str
    label: str
    description: str
    color: Callable[[Surface, float], NDArray[np.float64]]
    """(surface, deviation range in metres) -> (V, 3) or (3,) sRGB."""
    legend: Callable[[float], list[Swatch]]
    """Deviation range in metres -> what each colour means."""


def rgba(mode: Mode, surface: Surface, deviation_range: float) -> NDArray[np.float32]:
    """(V, 4) linear colours, as Blender's float colour attributes hold them."""
    color = np.ones((len(surface.deviation), 4), dtype=np.float32)
    color[:, :3] = palette.to_linear(mode.color(surface, deviation_range))
    return color


STATION_COLORS = np.array([
    (0.35, 0.55, 0.75), (0.80, 0.60, 0.35), (0.45, 0.65, 0.45),
    (0.70, 0.50, 0.65), (0.65, 0.65, 0.40), (0.40, 0.65, 0.65),
])  # fmt: skip
"""Muted, so that they are not taken for a verdict; stations beyond the last start over."""


def scan_color(color: NDArray[np.uint8] | None, station: NDArray[np.int32]) -> NDArray[np.float64]:
    """(N, 3) linear colours of scan points: the file's own, or one per station where it has none."""
    srgb = STATION_COLORS[station % len(STATION_COLORS)] if color is None else color / 255.0
    return palette.to_linear(srgb)


def _status(surface: Surface, _range: float) -> NDArray[np.float64]:
    return np.array(palette.STATUS_COLORS.get(surface.status, palette.UNMEASURED))


def _loa(surface: Surface, _range: float) -> NDArray[np.float64]:
    if surface.status == "NOTOBSERVED":
        return np.array(palette.UNMEASURED)
    return np.array(LOA_COLORS.get(surface.achieved_loa, palette.UNMEASURED))


def _belief(surface: Surface, _range: float) -> NDArray[np.float64]:
    return palette.belief_color(surface.occupied, surface.empty, surface.unknown)


def _deviation(surface: Surface, deviation_range: float) -> NDArray[np.float64]:
    return palette.deviation_color(surface.deviation, deviation_range)


def _deviation_legend(deviation_range: float) -> list[Swatch]:
    steps = np.linspace(deviation_range, -deviation_range, 9)
    colors = palette.deviation_color(steps, deviation_range)
    swatches: list[Swatch] = [(f"{1000 * d:+.1f} mm", (c[0], c[1], c[2])) for d, c in zip(steps, colors, strict=True)]
    return [*swatches, ("not measured", palette.UNMEASURED)]


MODES: tuple[Mode, ...] = (
    Mode(
        "STATUS",
        "Status",
        "The verdict on the whole element",
        _status,
        lambda _: [(palette.STATUS_LABELS[s], palette.STATUS_COLORS[s]) for s in palette.STATUS_LABELS],
    ),
    Mode(
        "BELIEF",
        "Evidence",
        "Where the scans say occupied, empty or nothing",
        _belief,
        lambda _: [(name.capitalize(), color) for name, color in palette.BELIEF_COLORS.items()],
    ),
    Mode("DEVIATION", "Deviation", "Signed distance of the scan from the planned surface", _deviation, _deviation_legend),
    Mode(
        "LOA",
        "Level reached",
        "The level of accuracy that the element reaches",
        _loa,
        lambda _: [*LOA_COLORS.items(), ("Not observed", palette.UNMEASURED)],
    ),
)
BY_IDENTIFIER = {mode.identifier: mode for mode in MODES}
