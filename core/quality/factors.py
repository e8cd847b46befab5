"""The nine quality factors of a scan campaign, each with a number or the reason why this file does not give one."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from .color import ColorStudy
from .noise import EdgeStudy
from .results import ElementQuality, Factor, Measured


def nine_factors(
    whole: Measured, elements: tuple[ElementQuality, ...], edges: EdgeStudy, color: ColorStudy, registration: float | None,
    returns: int, paths: tuple[str, ...], place: float = 0.0,
) -> tuple[Factor, ...]:
    """Resolution, coverage, their consistency, registration, clarity, manageability, colour, accuracy and position.

    ``place`` [m] is the sigma of where all stations stand together, as far as it is known.
    """
    return (
        _factor("Resolution", whole.spacing, "m", "median distance between returns on the surfaces seen", 1000, "mm"),
        Factor(
            "Coverage", whole.coverage, "1",
            f"{whole.coverage:.1%} of the surface that neighbours leave free has returns, {whole.turned_away:.1%} faces no "
            "station",
        ),
        _factor(
            "Resolution consistency", whole.consistency, "1", "95th percentile of the spacing over its median", 1, "",
        ),
        _registration(registration),
        _clarity(edges),
        _manageability(returns, paths, whole),
        _color(color),
        _accuracy(elements),
        _position(whole, registration, place),
    )


def _factor(name: str, value: float | None, unit: str, meaning: str, scale: float, shown: str) -> Factor:
    if value is None:
        return Factor(name, None, unit, "not measurable from this file: no return lies on the planned surface")
    return Factor(name, value, unit, f"{scale * value:.1f}{' ' + shown if shown else ''}: {meaning}")


def _registration(registration: float | None) -> Factor:
    name = "Registration accuracy consistency"
    if registration is None:
        return Factor(name, None, "m", "not measurable from this file: no surface was seen from two stations")
    return Factor(
        name, registration, "m", f"{1000 * registration:.1f} mm: standard deviation of a station against the others in overlaps"
    )


def _clarity(edges: EdgeStudy) -> Factor:
    if len(edges.residual) < 100:
        return Factor("Clarity", None, "1", "not measurable from this file: too few returns lie near edges of the model")
    share = float(np.isfinite(edges.residual).mean())
    return Factor("Clarity", share, "1", f"{share:.1%} of the returns near edges lie on a surface; the others hang in the air")


def _manageability(returns: int, paths: tuple[str, ...], whole: Measured) -> Factor:
    size = 0
    for path in dict.fromkeys(paths):
        try:
            size += Path(path).stat().st_size
        except OSError:
            continue
    area = whole.area * whole.coverage
    density = f", {returns / area:,.0f} a square metre of surface seen" if area > 0 else ""
    text = f"{returns:,} returns{density}"
    if not size:
        return Factor("Manageability", float(returns), "returns", text)
    return Factor("Manageability", size / 1e9, "GB", f"{size / 1e9:.2f} GB in files, {text}")


def _color(color: ColorStudy) -> Factor:
    if color.shift_rad is None:
        return Factor("Color quality", None, "rad", f"not measurable from this file: {color.why}")
    return Factor("Color quality", color.shift_rad, "rad", color.why)


def _accuracy(elements: tuple[ElementQuality, ...]) -> Factor:
    name = "Measurement accuracy"
    known = [(e.predicted_error, e.measured.area) for e in elements if e.predicted_error is not None]
    if not known:
        return Factor(name, None, "m", "not measurable from this file: no element has the returns for a model")
    error = sum(e * a for e, a in known) / max(sum(a for _, a in known), 1e-12)
    return Factor(name, error, "m", f"{1000 * error:.1f} mm: expected error of an as-built model, mean over the surface")


def _position(whole: Measured, registration: float | None, place: float) -> Factor:
    name = "Positional uncertainty"
    if whole.noise is None or registration is None:
        lacking = "noise" if whole.noise is None else "how well the stations agree"
        return Factor(name, None, "m", f"not measurable from this file: it does not show {lacking}")
    sigma = math.hypot(whole.noise, registration, place)
    if place > 0:
        text = f"{1000 * sigma:.1f} mm: one return, noise, registration and the place of a block of photos together"
        return Factor(name, sigma, "m", text)
    return Factor(
        name, sigma, "m", f"{1000 * sigma:.1f} mm: one return, noise and registration together; a shift that all stations "
        "share does not show without control points",
    )
