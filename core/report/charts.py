"""The charts of the report as inline SVG. Only numbers and the project's own words go in: nothing to escape."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from markupsafe import Markup

from ..results import LEVELS, STATUSES, VerificationResult
from ..sensing.loa import UPPER_BOUND_M, level_of
from .palette import STATUS_LABELS, deviation_color, to_bytes
from .rows import nice_limit_mm

Scale = Callable[[float], float]
WIDTH, HEIGHT = 560, 260
LEFT, RIGHT, TOP, BOTTOM = 46, 22, 20, 42


def deviation_histogram(result: VerificationResult, color_limit_m: float, bins: int = 61) -> Markup | None:
    """Measured area over signed deviation, with the band of the level asked for; None where nothing was measured.

    The axis reaches at most twice the level's bound; what lies beyond is gathered in the outermost bars.
    """
    deviation = result.evidence.deviation
    known = np.isfinite(deviation)
    if not known.any():
        return None
    bound = UPPER_BOUND_M[result.options.loa] * 1000.0
    limit = nice_limit_mm(deviation, bound / 2.0, 0.98, most_mm=2.0 * bound)
    beyond = [bool((deviation[known] < -limit / 1000.0).any()), bool((deviation[known] > limit / 1000.0).any())]
    values = np.clip(deviation[known].astype(np.float64) * 1000.0, -limit, limit)
    area, edge = np.histogram(values, bins=bins, range=(-limit, limit), weights=result.samples.area[known])
    share = 100.0 * area / area.sum()
    top = _round_up(float(share.max()))
    x = _scale(-limit, limit, LEFT, WIDTH - RIGHT)
    y = _scale(0.0, top, HEIGHT - BOTTOM, TOP)
    color = to_bytes(deviation_color((edge[1:] + edge[:-1]) / 2000.0, color_limit_m))
    shown = min(bound, limit)
    parts = [_rect(x(-shown), TOP, x(shown) - x(-shown), HEIGHT - BOTTOM - TOP, "band")]
    parts += _y_axis(y, top, " %")
    for k in range(bins):
        if share[k] > 0:
            fill = "#{:02x}{:02x}{:02x}".format(*color[k])
            span = f"{edge[k]:+z.1f} to {edge[k + 1]:+z.1f} mm"
            if (k == 0 and beyond[0]) or (k == bins - 1 and beyond[1]):
                span = f"{'below' if k == 0 else 'above'} {edge[1] if k == 0 else edge[k]:+z.1f} mm"
            tip = f"{span}: {share[k]:.1f} % of the measured area"
            parts.append(_bar(x(edge[k]) + 0.4, y(share[k]), x(edge[k + 1]) - x(edge[k]) - 0.8, y(0) - y(share[k]),
                              f'class="bin" fill="{fill}"', tip))  # fmt: skip
    parts.append(f'<line class="zero" x1="{x(0):.1f}" x2="{x(0):.1f}" y1="{TOP}" y2="{y(0):.1f}"/>')
    ticks = [_signed(v) for v in np.linspace(-limit, limit, 5)]
    ticks[0], ticks[-1] = ("≤ " if beyond[0] else "") + ticks[0], ("≥ " if beyond[1] else "") + ticks[-1]
    parts += [
        _label(x(v), HEIGHT - BOTTOM + 16, tick) for v, tick in zip(np.linspace(-limit, limit, 5), ticks, strict=True)
    ]
    parts.append(_label((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, "deviation from the planned surface, mm"))
    parts.append(_label(x(shown) - 4, TOP - 6, f"LOA{result.options.loa} ±{bound:g}", "end", "tag"))
    return _svg(parts, f"Histogram of deviations, share of the measured area, from {-limit:g} to {limit:g} millimetres")


def coverage_chart(result: VerificationResult, bins: int = 10) -> Markup:
    """Elements over coverage, stacked by status."""
    count = np.zeros((len(STATUSES), bins), dtype=np.int64)
    for verdict in result.verdicts:
        count[STATUSES.index(verdict.status), min(int(verdict.coverage * bins), bins - 1)] += 1
    top = _round_up(float(count.sum(axis=0).max()))
    x = _scale(0.0, bins, LEFT, WIDTH - RIGHT)
    y = _scale(0.0, top, HEIGHT - BOTTOM, TOP)
    parts = _y_axis(y, top, "")
    for k in range(bins):
        base = 0
        for s in range(len(STATUSES)):
            n = int(count[s, k])
            if n:
                tip = f"{100 * k / bins:.0f}–{100 * (k + 1) / bins:.0f} % covered: {n} {STATUS_LABELS[STATUSES[s]]}"
                parts.append(_bar(x(k) + 3, y(base + n), x(k + 1) - x(k) - 6, y(base) - y(base + n),
                                  f'class="s-{STATUSES[s].lower()}"', tip))  # fmt: skip
            base += n
    parts += [_label(x(k), HEIGHT - BOTTOM + 16, f"{100 * k / bins:.0f}") for k in range(0, bins + 1, 2)]
    parts.append(_label((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, "coverage of the element's surface, %"))
    return _svg(parts, "Number of elements by coverage, stacked by status")


def level_chart(result: VerificationResult) -> Markup:
    """Per level: the share of elements that reach it, and the share of the observed area confirmed at it."""
    seen = [v for v in result.verdicts if v.observed_count]
    weight = np.array([v.area * v.coverage for v in seen])
    step = (HEIGHT - TOP - BOTTOM) / len(LEVELS)
    x = _scale(0.0, 100.0, LEFT + 76, WIDTH - RIGHT - 34)
    parts = [_line(x(v), TOP - 6, x(v), HEIGHT - BOTTOM) for v in (0, 25, 50, 75, 100)]
    parts += [_label(x(v), HEIGHT - BOTTOM + 16, f"{v}") for v in (0, 25, 50, 75, 100)]
    for k, level in enumerate(LEVELS):
        reached = sum(level_of(v.achieved_loa) >= level for v in seen)
        share = 100.0 * reached / len(seen) if seen else 0.0
        ratio = np.array([v.confirmed_ratio.get(level, 0.0) for v in seen])
        area = 100.0 * float(ratio @ weight / weight.sum()) if weight.sum() > 0 else 0.0
        row = TOP + k * step
        asked = level == result.options.loa
        if asked:
            parts.append(_rect(4, row - 2, WIDTH - 8, step - 2, "band"))
        bound = UPPER_BOUND_M[level] * 1000.0
        parts.append(_label(12, row + step / 2 + 1, f"LOA{level}", "start", "strong" if asked else ""))
        parts.append(_label(64, row + step / 2 + 1, f"±{bound:g} mm", "start", "small"))
        tip = f"{reached} of {len(seen)} observed elements reach LOA{level}"
        parts.append(_bar(x(0), row + 5, x(share) - x(0), step - 22, 'class="accent"', tip))
        tip = f"{area:.1f} % of the observed area is confirmed at LOA{level}"
        parts.append(_bar(x(0), row + step - 14, x(area) - x(0), 5, 'class="accent2"', tip))
        parts.append(_label(x(100) + 8, row + step / 2 + 1, f"{share:.0f} %", "start"))
    parts.append(_label((x(0) + x(100)) / 2, HEIGHT - 6, "% of elements (wide) and of the observed area (thin)"))
    return _svg(parts, "Share of elements and of observed area that reach each level of accuracy")


def _scale(low: float, high: float, start: float, end: float) -> Scale:
    return lambda value: start + (value - low) / (high - low) * (end - start)


def _round_up(value: float) -> float:
    """The next of 1, 2, 4, 5, 10, 20, ... at or above ``value``."""
    if value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(f * power for f in (1, 2, 4, 5, 8, 10) if f * power >= value - 1e-9))


def _y_axis(y: Scale, top: float, unit: str) -> list[str]:
    parts = []
    for value in np.linspace(0.0, top, 5):
        parts.append(_line(LEFT, y(value), WIDTH - RIGHT, y(value)))
        if value or unit == "":
            text = f"{value:g}{unit}" if abs(value - round(value)) < 1e-9 or unit else ""
            parts.append(_label(LEFT - 6, y(value) + 4, text, "end"))
    return parts


def _signed(value: float) -> str:
    return "0" if abs(value) < 1e-9 else f"{value:+g}".replace("-", "−")


def _svg(parts: Sequence[str], title: str) -> Markup:
    return Markup(
        f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{title}">{"".join(parts)}</svg>'
    )


def _rect(x: float, y: float, width: float, height: float, kind: str) -> str:
    return f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="2"/>'


def _bar(x: float, y: float, width: float, height: float, paint: str, tip: str) -> str:
    return (
        f'<rect {paint} x="{x:.1f}" y="{y:.1f}" width="{max(width, 0):.1f}" height="{max(height, 0):.1f}" rx="1">'
        f"<title>{tip}</title></rect>"
    )


def _line(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line class="grid" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def _label(x: float, y: float, text: str, anchor: str = "middle", kind: str = "") -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'
