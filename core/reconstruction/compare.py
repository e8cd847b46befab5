"""A model against a reference, mostly a reconstruction: matches per class, differences, and a quality with fixed normalisation.

After Thomson and Boehm 2015: the mean of the normalised distance of middles in plan, area |length difference| x |width
difference|, and sine of the angle. They normalise by the largest value of a run, so two runs cannot be compared; here the
limits are fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from .opening_edges import SIDES
from .shapes import Shape, Shapes

Array = NDArray[np.float64]

MIDDLE_LIMIT_M = 0.5
AREA_LIMIT_M2 = 0.25
"""A distance, or an area of differences, from here on counts 1."""
AXIS_LIMIT_M = 0.15
"""Walls whose middle planes are farther apart are not the same wall."""
ANGLE_LIMIT = np.sin(np.radians(5.0))
LEAST_OVERLAP = 0.5
PLACE_LIMIT_M = 0.4
"""Middles of openings, doors, windows and columns."""
LEAST_COMMON = 0.5
"""Volume of the boxes' intersection over their union, for spaces and slabs."""


_AXIS, _MIDDLE, _HEIGHT = ("axis", "axis"), ("middle", "middle"), ("height", "height")
_SIZES = (("length", "length"), ("width", "width"), _HEIGHT)
_HOLE = (_AXIS, ("length", "width"), _HEIGHT)
SAID = {
    "walls": (_AXIS, ("width", "thickness"), ("length", "length"), _HEIGHT), "columns": (_MIDDLE, *_SIZES),
    "openings": _HOLE, "doors": _HOLE, "windows": _HOLE, "spaces": (_MIDDLE, *_SIZES), "slabs": (_MIDDLE, *_SIZES),
}
"""Differences that are told of each class, and their names: the length of a hole along its wall is its width."""
COUNTS = "places in plan, length times width, and angle count, heights do not"
"""What the number says, for a person."""


@dataclass(frozen=True)
class Match:
    """A pair, with its differences: reconstruction minus reference [m]."""

    found: Shape
    reference: Shape
    axis: float
    """Between the middle planes, metres."""
    middle: float
    """Between the middles, metres."""
    angle: float
    """Rad."""
    length: float
    width: float
    height: float
    edges: tuple[float, float, float, float]
    """Differences of the places of start, end (along the found wall), sill and head [m]."""

    @property
    def size(self) -> float:
        """The larger of the differences of length and width, metres."""
        return max(abs(self.length), abs(self.width))

    @property
    def edge(self) -> float:
        """Largest difference of an edge, metres."""
        return max(abs(e) for e in self.edges)

    @property
    def seen_edge(self) -> float:
        """Largest difference of an edge that the reconstruction says it saw, metres; 0 if it saw none."""
        return max((abs(e) for e, name in zip(self.edges, SIDES, strict=True) if name not in self.found.hidden), default=0.0)

    @property
    def edges_in_sigmas(self) -> list[tuple[bool, float]]:
        """For each edge whose standard deviation is known: whether it was seen, and its difference over that."""
        return [
            (name not in self.found.hidden, e / max(sigma, 1e-9))
            for e, name, sigma in zip(self.edges, SIDES, self.found.edge_sigma, strict=False)
        ]

    @property
    def quality(self) -> float:
        """0 in the same place, 1 as far apart as the limits, or more; a difference of length or height alone counts nothing."""
        area = abs(self.length) * abs(self.width)
        distance = float(np.linalg.norm((self.found.middle - self.reference.middle)[:2]))
        return (
            min(distance / MIDDLE_LIMIT_M, 1.0) + min(area / AREA_LIMIT_M2, 1.0) + abs(float(np.sin(self.angle)))
        ) / 3


@dataclass(frozen=True)
class ClassComparison:
    """All of one class."""

    kind: str
    found: int
    reference: int
    matches: tuple[Match, ...]
    missed: tuple[Shape, ...]
    extra: tuple[Shape, ...]

    @property
    def precision(self) -> float:
        """Share of what was found that is in the reference."""
        return len(self.matches) / self.found if self.found else float(self.reference == 0)

    @property
    def recall(self) -> float:
        """Share of the reference that was found."""
        return len(self.matches) / self.reference if self.reference else float(self.found == 0)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        total = self.precision + self.recall
        return 2 * self.precision * self.recall / total if total else 0.0

    def largest(self, what: str) -> float:
        """Largest absolute difference; 0 without matches."""
        return max((abs(float(getattr(m, what))) for m in self.matches), default=0.0)

    def median(self, what: str) -> float:
        """Median absolute difference; 0 without matches."""
        return float(np.median([abs(getattr(m, what)) for m in self.matches])) if self.matches else 0.0


@dataclass(frozen=True)
class Comparison:
    """All classes that either model has."""

    classes: dict[str, ClassComparison] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    """What was not compared, and what looks wrong."""

    @property
    def quality(self) -> float:
        """Mean over all elements of the reference and those that are in none; what has no partner counts 1."""
        values = [m.quality for c in self.classes.values() for m in c.matches]
        alone = sum(len(c.missed) + len(c.extra) for c in self.classes.values())
        return float((sum(values) + alone) / max(len(values) + alone, 1))


def compare(found: Shapes, reference: Shapes) -> Comparison:
    """Match the elements of two models class by class, one to one."""
    classes = {}
    for kind in reference:
        a, b = found.get(kind, []), reference[kind]
        if a or b:
            classes[kind] = _compare_class(kind, a, b)
    return Comparison(classes, (*_left_out(found, "model"), *_left_out(reference, "reference"), *_apart(found, reference)))


def _left_out(shapes: Shapes, whose: str) -> list[str]:
    parts = [f"{what}: {count}" for what, count in shapes.left_out.items()]
    return [f"Not compared, of the {whose}: {', '.join(parts)}."] if parts else []


def _apart(found: Shapes, reference: Shapes) -> list[str]:
    """A sentence where the two models share no place."""
    (low_a, high_a), (low_b, high_b) = _bounds(found), _bounds(reference)
    if (low_a <= high_b).all() and (low_b <= high_a).all():
        return []
    x, y, z = 0.5 * (low_a + high_a - low_b - high_b)
    return [
        f"The models do not overlap: the middle of the first lies {x:z.1f}, {y:z.1f}, {z:z.1f} m from that of the reference "
        "(x, y, z), so they are probably in different frames."
    ]


def _bounds(shapes: Shapes) -> tuple[Array, Array]:
    all_of = [s for own in shapes.values() for s in own]
    reach = [np.append(np.full(2, np.hypot(s.length, s.width) / 2), s.height / 2) for s in all_of]
    middle = np.array([s.middle for s in all_of])
    return (middle - reach).min(axis=0), (middle + reach).max(axis=0)


def _compare_class(kind: str, found: list[Shape], reference: list[Shape]) -> ClassComparison:
    cost = np.full((len(found), len(reference)), 1e6)
    pairs: dict[tuple[int, int], Match] = {}
    for i, a in enumerate(found):
        for j, b in enumerate(reference):
            match = _match(kind, a, b)
            if match is not None:
                pairs[i, j] = match
                cost[i, j] = match.quality
    rows, columns = linear_sum_assignment(cost)
    matches = [pairs[i, j] for i, j in zip(rows.tolist(), columns.tolist(), strict=True) if (i, j) in pairs]
    used_a, used_b = {m.found.global_id for m in matches}, {m.reference.global_id for m in matches}
    return ClassComparison(
        kind, len(found), len(reference), tuple(matches), tuple(b for b in reference if b.global_id not in used_b),
        tuple(a for a in found if a.global_id not in used_a),
    )


def _match(kind: str, a: Shape, b: Shape) -> Match | None:
    if a.round:
        a = replace(a, along=b.along)
    elif b.round:
        b = replace(b, along=a.along)
    cosine = float(np.clip(abs(a.along @ b.along), 0.0, 1.0))
    angle = float(np.arccos(cosine))
    turned = kind not in ("walls", "openings") and angle > np.pi / 4
    along = np.array([-a.along[1], a.along[0]]) if turned else a.along
    length, width = (a.width, a.length) if turned else (a.length, a.width)
    if turned:
        angle = float(np.arccos(np.clip(abs(along @ b.along), 0.0, 1.0)))
    step = a.middle - b.middle
    axis, slide, rise = float(step[:2] @ b.across), float(step[:2] @ b.along), float(step[2])
    if kind == "walls":
        overlap = (length + b.length) / 2 - abs(slide)
        vertical = (a.height + b.height) / 2 - abs(rise)
        if (
            abs(axis) > AXIS_LIMIT_M or np.sin(angle) > ANGLE_LIMIT or overlap < LEAST_OVERLAP * min(length, b.length)
            or overlap < 0.3 * max(length, b.length) or vertical < 0.5 * min(a.height, b.height)
        ):
            return None
    elif kind in ("spaces", "slabs"):
        common = (
            max((length + b.length) / 2 - abs(slide), 0.0) * max((width + b.width) / 2 - abs(axis), 0.0)
        )
        common = min(common, length * width, b.length * b.width)
        if common / max(length * width + b.length * b.width - common, 1e-9) < LEAST_COMMON or abs(rise) > 1.0:
            return None
    elif np.linalg.norm(step) > PLACE_LIMIT_M:
        return None
    # along the found element, so that its start and end are meant
    slide = -slide if float(along @ b.along) < 0 else slide
    long, high = (length - b.length) / 2, (a.height - b.height) / 2
    edges = (slide - long, slide + long, rise - high, rise + high)
    return Match(
        a, b, abs(axis), float(np.linalg.norm(step)), angle, length - b.length, width - b.width, a.height - b.height, edges
    )


def comparison_to_json(result: Comparison) -> dict[str, Any]:
    """Plain values, metres and degrees."""
    return {
        "quality": result.quality,
        "limits": {"middle_m": MIDDLE_LIMIT_M, "area_m2": AREA_LIMIT_M2}, "notes": list(result.notes),
        "classes": {
            kind: {
                "found": c.found, "reference": c.reference, "matched": len(c.matches), "precision": c.precision,
                "recall": c.recall, "f1": c.f1,
                "axis_max_m": c.largest("axis"), "width_max_m": c.largest("width"), "edge_max_m": c.largest("edge"),
                "length_max_m": c.largest("length"), "height_max_m": c.largest("height"), "middle_max_m": c.largest("middle"),
                "angle_max_deg": float(np.degrees(c.largest("angle"))),
                "pairs": [
                    {
                        "found": m.found.global_id, "reference": m.reference.global_id, "quality": m.quality,
                        "middle_m": m.middle, "axis_m": m.axis, "angle_deg": float(np.degrees(m.angle)),
                        "length_m": m.length, "width_m": m.width, "height_m": m.height, "edge_m": m.edge,
                        "seen_edge_m": m.seen_edge,
                    }
                    for m in c.matches
                ],
                "missed": [s.global_id for s in c.missed], "extra": [s.global_id for s in c.extra],
            }
            for kind, c in result.classes.items()
        },
    }


def comparison_lines(result: Comparison) -> list[str]:
    """For a person; the number comes last."""
    out = []
    for kind, c in result.classes.items():
        if not c.reference:
            out.append(f"{kind}: {c.found} found, none in the reference.")
            continue
        text = f"{kind}: {len(c.matches)} of {c.reference} found, {len(c.extra)} not in the reference, F1 {c.f1:.3f}"
        if c.matches:
            parts = [_median(c, what, name) for what, name in SAID[kind]]
            parts.append(f"angle {np.degrees(c.median('angle')):.2f} (at most {np.degrees(c.largest('angle')):.2f}) degrees")
            if kind == "openings":
                hidden = sum(len(m.found.hidden) for m in c.matches)
                parts.append(f"edges that were seen at most {c.largest('seen_edge') * 1000:.1f} mm")
                them = "hidden one" if hidden == 1 else f"{hidden} hidden ones"
                parts += [f"with the {them} {c.largest('edge') * 1000:.1f} mm"] if hidden else []
            text += "; " + ", ".join(parts)
        out.append(text + ".")
    out += result.notes
    out.append(f"Thomson and Boehm's number: {result.quality:.3f} ({COUNTS}; 1 for what has no partner).")
    return out


def _median(c: ClassComparison, what: str, name: str) -> str:
    return f"{name} {1000 * c.median(what):.1f} (at most {1000 * c.largest(what):.1f}) mm"
