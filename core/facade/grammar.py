"""A facade as a split grammar: floors by the levels, floors into tiles, tiles into walls, windows and doors.

Sizes are metres. A size with ``~`` is relative: what the absolute ones leave is shared in proportion. ``{ ... }*3`` repeats
its parts three times. A terminal is ``Wall``, or kind and number of a type, as ``Window1``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from .records import Facade, FacadeBox

Axis = Literal["x", "z"]
Rect = tuple[float, float, float, float]
"""x0, z0, x1, z1 in the wall frame."""
TOLERANCE_M = 0.10
"""What the grammar gives back lies this near to what was found: one standard deviation of a width."""
OVERLAP_M = 0.05
"""Elements that overlap by less are cut apart in the middle."""
SAME_M = 1e-6
WALL = "Wall"


@dataclass(frozen=True)
class Split:
    """Parts along an axis, from the left or from below."""

    axis: Axis
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class Part:
    """A terminal, a rule's name, or a split of its own; ``count`` times."""

    size: float
    inside: str | Split
    relative: bool = False
    count: int = 1


@dataclass(frozen=True)
class Grammar:
    """Rules by name; the first is the facade."""

    rules: dict[str, Split]
    size: tuple[float, float]
    largest_error: float
    """Of an edge of what it gives back, metres."""
    left_out: tuple[FacadeBox, ...] = ()
    """Elements that no straight cut parts from their neighbours."""

    def notes(self) -> str:
        """How near what it gives back lies, and what it leaves out."""
        out = f"What it gives back lies within {100 * self.largest_error:.1f} cm of what was found."
        if self.left_out:
            out += f" {len(self.left_out)} elements that overlap or that no straight cut parts are not in it."
        return out

    def boxes(self) -> list[tuple[str, Rect]]:
        """Terminal and place of every window and door that it gives back."""
        return expand(self.rules, next(iter(self.rules)), (0.0, 0.0, *self.size))

    def text(self) -> str:
        """One rule a line."""
        return "\n".join(f"{name} -> {_split_text(split)}" for name, split in self.rules.items())


def terminal(box: FacadeBox) -> str:
    """Its kind and the number of its type, counted from 1."""
    return f"{box.kind.title()}{box.type + 1}"


def grammar_of(facade: Facade) -> Grammar:
    """The grammar of what was found on a facade."""
    return grammar(facade.boxes, facade.levels, facade.scale.width, facade.scale.height)


def grammar(boxes: Sequence[FacadeBox], levels: Sequence[float], width: float, height: float) -> Grammar:
    """The grammar of the elements on a facade whose floors begin at ``levels`` [m]."""
    inside = [
        replace(b, x0=max(b.x0, 0.0), z0=max(b.z0, 0.0), x1=min(b.x1, width), z1=min(b.z1, height)) for b in boxes
    ]
    return _Builder(width).build([b for b in inside if b.x0 < b.x1 and b.z0 < b.z1], levels, height)


def expand(rules: dict[str, Split], inside: str | Split, rect: Rect) -> list[tuple[str, Rect]]:
    """What a rule, a terminal or a split makes of a rectangle; walls are left out."""
    if isinstance(inside, str):
        if inside not in rules:
            return [] if inside == WALL else [(inside, rect)]
        inside = rules[inside]
    along = 0 if inside.axis == "x" else 1
    length = rect[along + 2] - rect[along]
    absolute = sum(p.size * p.count for p in inside.parts if not p.relative)
    shares = sum(p.size * p.count for p in inside.parts if p.relative)
    stretch = max(length - absolute, 0.0) / shares if shares > 0 else 1.0
    out, at = [], rect[along]
    for part in inside.parts:
        size = part.size * (stretch if part.relative else 1.0)
        for _ in range(part.count):
            out += expand(rules, part.inside, _cut(rect, along, at, at + size))
            at += size
    return out


class _Builder:
    def __init__(self, width: float) -> None:
        self.width = width
        self.rules: dict[str, Split] = {}
        self.left_out: list[FacadeBox] = []

    def build(self, boxes: list[FacadeBox], levels: Sequence[float], height: float) -> Grammar:
        whole = (0.0, 0.0, self.width, height)
        parts, inner = [], []
        for base, top, own in _bands(boxes, levels, height):
            rect = (0.0, base, self.width, top)
            name = self._same("Floor", rect, own) or self._floor(rect, own)
            parts.append(Part(top - base, name))
            inner.append(own)
        first = Split("z", self._repeated(parts, inner, 1, whole))
        rules = {"Facade": first, **dict(sorted(self.rules.items(), key=lambda r: r[0].startswith("Tile")))}
        error = _largest_error(expand(rules, "Facade", whole), self._kept(boxes))
        return Grammar(rules, (self.width, height), error, tuple(self.left_out))

    def _floor(self, rect: Rect, boxes: list[FacadeBox]) -> str:
        """A rule of tiles: each has one column of elements, and half of the wall to its neighbours."""
        columns = _groups(boxes, 0)
        if not columns:
            return self._add("Floor", Split("x", (Part(self.width, WALL, relative=True),)))
        low, high = [_low(c, 0) for c in columns], [_high(c, 0) for c in columns]
        between = [0.5 * (a + b) for a, b in zip(high, low[1:], strict=False)]
        # an end tile is as wide beyond its element as within, where there is room
        start = max(low[0] - (between[0] - high[0]), 0.0) if between else low[0]
        end = min(high[-1] + (low[-1] - between[-1]), self.width) if between else high[-1]
        edges = [min(start, low[0]), *between, max(end, high[-1])]
        parts: list[Part] = []
        for column, left, right in zip(columns, edges, edges[1:], strict=False):
            tile = (left, rect[1], right, rect[3])
            name = self._same("Tile", tile, column) or self._add("Tile", self._split(column, tile, 0, False))
            parts.append(Part(right - left, name))
        run = self._repeated(parts, columns, 0, (edges[0], rect[1], edges[-1], rect[3]))
        return self._add("Floor", Split("x", _with_walls(edges[0], run, self.width - edges[-1])))

    def _split(self, boxes: list[FacadeBox], rect: Rect, along: int, tried: bool) -> Split:
        """Cuts between the elements along one axis, and along the other one inside of what they part."""
        groups = _groups(boxes, along)
        if len(groups) == 1 and tried and len(boxes) > 1:
            largest = max(boxes, key=lambda b: b.width * b.height)
            self.left_out += [b for b in boxes if b is not largest]
            groups = [[largest]]
        parts: list[Part] = []
        at = rect[along]
        for k, group in enumerate(groups):
            low, high = max(_low(group, along), at), _high(group, along)
            if k + 1 < len(groups) and _low(groups[k + 1], along) < high:
                high = 0.5 * (high + _low(groups[k + 1], along))
            high = max(min(high, rect[along + 2]), low)
            if low > at:
                parts.append(Part(low - at, WALL, relative=True))
            inner = _cut(rect, along, low, high)
            filled = len(group) == 1 and _fills(group[0], inner)
            inside = terminal(group[0]) if filled else self._split(group, inner, 1 - along, len(groups) == 1)
            parts.append(Part(high - low, inside))
            at = high
        if rect[along + 2] > at:
            parts.append(Part(rect[along + 2] - at, WALL, relative=True))
        return Split("x" if along == 0 else "z", tuple(parts))

    def _add(self, kind: str, split: Split) -> str:
        name = f"{kind}{sum(n.startswith(kind) for n in self.rules) + 1}"
        self.rules[name] = split
        return name

    def _same(self, kind: str, rect: Rect, boxes: list[FacadeBox]) -> str:
        """A rule that gives back these elements; empty if none does."""
        return next((n for n in self.rules if n.startswith(kind) and self._gives(n, rect, boxes)), "")

    def _gives(self, inside: str | Split, rect: Rect, boxes: list[FacadeBox]) -> bool:
        return _largest_error(expand(self.rules, inside, rect), self._kept(boxes)) <= TOLERANCE_M

    def _kept(self, boxes: list[FacadeBox]) -> list[FacadeBox]:
        return [b for b in boxes if not any(b is other for other in self.left_out)]

    def _repeated(self, parts: list[Part], inner: list[list[FacadeBox]], along: int, rect: Rect) -> tuple[Part, ...]:
        """Neighbours of one rule as one repeat, as many as still give back their elements."""
        out: list[Part] = []
        begin, at = 0, rect[along]
        while begin < len(parts):
            best, total = 1, parts[begin].size
            for count in range(2, len(parts) - begin + 1):
                run = parts[begin : begin + count]
                if run[-1].inside != run[0].inside:
                    break
                length = sum(p.size for p in run)
                one = Split("x" if along == 0 else "z", (replace(run[0], size=length / count, count=count),))
                own = [b for group in inner[begin : begin + count] for b in group]
                if self._gives(one, _cut(rect, along, at, at + length), own):
                    best, total = count, length
            out.append(replace(parts[begin], size=total / best, count=best))
            begin, at = begin + best, at + total
        return tuple(out)


def _bands(boxes: list[FacadeBox], levels: Sequence[float], height: float) -> list[tuple[float, float, list[FacadeBox]]]:
    """Floors with their elements; floors that an element reaches across are one."""
    edges = [v for v in levels if 0.0 < v < height and not any(b.z0 + OVERLAP_M < v < b.z1 - OVERLAP_M for b in boxes)]
    out = []
    for base, top in zip([0.0, *edges], [*edges, height], strict=True):
        out.append((base, top, [b for b in boxes if base <= 0.5 * (b.z0 + b.z1) < top]))
    return out


def _groups(boxes: list[FacadeBox], along: int) -> list[list[FacadeBox]]:
    """Elements that overlap along the axis belong together."""
    out: list[list[FacadeBox]] = []
    for box in sorted(boxes, key=lambda b: _low([b], along)):
        if out and _low([box], along) < _high(out[-1], along) - OVERLAP_M:
            out[-1].append(box)
        else:
            out.append([box])
    return out


def _low(boxes: Sequence[FacadeBox], along: int) -> float:
    return min(b.x0 if along == 0 else b.z0 for b in boxes)


def _high(boxes: Sequence[FacadeBox], along: int) -> float:
    return max(b.x1 if along == 0 else b.z1 for b in boxes)


def _cut(rect: Rect, along: int, low: float, high: float) -> Rect:
    return (low, rect[1], high, rect[3]) if along == 0 else (rect[0], low, rect[2], high)


def _fills(box: FacadeBox, rect: Rect) -> bool:
    x0, z0, x1, z1 = rect
    return box.x0 <= x0 + SAME_M and box.z0 <= z0 + SAME_M and box.x1 >= x1 - SAME_M and box.z1 >= z1 - SAME_M


def _with_walls(before: float, parts: Sequence[Part], behind: float) -> tuple[Part, ...]:
    left, right = ((Part(v, WALL, relative=True),) if v > 0 else () for v in (before, behind))
    return (*left, *parts, *right)


def _largest_error(given: list[tuple[str, Rect]], boxes: list[FacadeBox]) -> float:
    """Largest distance of an edge to that of the element that it stands for; infinite where they are not the same."""
    if len(given) != len(boxes):
        return float("inf")
    worst, rest = 0.0, list(given)
    for box in boxes:
        place, name = (box.x0, box.z0, box.x1, box.z1), terminal(box)
        errors = [max(abs(a - b) for a, b in zip(place, r, strict=True)) if n == name else float("inf") for n, r in rest]
        nearest = min(range(len(rest)), key=errors.__getitem__)
        worst = max(worst, errors[nearest])
        del rest[nearest]
    return worst


def _split_text(split: Split) -> str:
    return f"split({split.axis}) {{ {' | '.join(_part_text(p) for p in split.parts)} }}"


def _part_text(part: Part) -> str:
    inside = part.inside if isinstance(part.inside, str) else _split_text(part.inside)
    text = f"{'~' if part.relative else ''}{part.size:.3f} : {inside}"
    return text if part.count == 1 else f"{{ {text} }}*{part.count}"
