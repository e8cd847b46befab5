"""The building from above with what stands on its floors, as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from ..model.elements import BuildingModel

MOST_LINES = 6000
SHORTEST_M = 0.05
WIDTH = 1000.0


@dataclass(frozen=True)
class Mark:
    """A numbered dot. Position (3,) metres, model frame."""

    label: str
    title: str
    position: tuple[float, float, float]
    kind: str = "station"


@dataclass(frozen=True)
class Area:
    """A rectangle, from corner to corner; metres, model frame."""

    title: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def draw_floor_plan(model: BuildingModel, marks: Sequence[Mark], areas: Sequence[Area] = ()) -> Markup:
    """All level edges of the model, its marks and areas, seen from above; y up."""
    from ..quality.edges import feature_edges

    segment = feature_edges(model)[0][:, :, :2]
    length = np.linalg.norm(segment[:, 1] - segment[:, 0], axis=1)
    order = np.argsort(-length, kind="stable")
    segment = segment[order[length[order] > SHORTEST_M]]
    segment = np.unique(np.round(segment.reshape(-1, 4), 2), axis=0)
    if len(segment) > MOST_LINES:
        size = np.linalg.norm(segment[:, 2:] - segment[:, :2], axis=1)
        segment = segment[np.argsort(-size, kind="stable")[:MOST_LINES]]
    places = np.array([m.position[:2] for m in marks]).reshape(-1, 2) - model.origin[:2]
    points = np.concatenate([segment.reshape(-1, 2), places])
    low, high = points.min(axis=0) - 0.5, points.max(axis=0) + 0.5
    scale = WIDTH / float(max(high[0] - low[0], 1e-6))
    height = scale * float(high[1] - low[1])

    def to_page(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([(xy[:, 0] - low[0]) * scale, (high[1] - xy[:, 1]) * scale])

    start, end = to_page(segment[:, :2]), to_page(segment[:, 2:])
    path = "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in zip(start, end, strict=True))
    out = [
        Markup('<svg viewBox="0 0 {} {}" role="img" aria-label="Plan">').format(f"{WIDTH:.0f}", f"{height:.0f}"),
        Markup('<path class="wall" d="{}"/>').format(path),
    ]
    for area in areas:
        a = to_page(np.array([area.low[:2], area.high[:2]]) - model.origin[:2])
        x, y, w, h = a[0, 0], a[1, 1], a[1, 0] - a[0, 0], a[0, 1] - a[1, 1]
        out.append(Markup('<rect class="clutter" x="{}" y="{}" width="{}" height="{}"><title>{}</title></rect>').format(
            f"{x:.1f}", f"{y:.1f}", f"{max(w, 2.0):.1f}", f"{max(h, 2.0):.1f}", area.title
        ))
    for mark, at in zip(marks, to_page(places), strict=True):
        x, y = f"{at[0]:.1f}", f"{at[1]:.1f}"
        out.append(Markup(
            '<g><circle class="{}" cx="{}" cy="{}" r="9"/><text x="{}" y="{}">{}</text><title>{}</title></g>'
        ).format(mark.kind, x, y, x, y, mark.label, mark.title))
    out.append(Markup("</svg>"))
    return Markup("").join(out)
