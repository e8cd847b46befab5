"""The split grammar of a facade: its text, read by a small reader of its own, gives back the elements."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from bim_verify.core.facade.grammar import TOLERANCE_M, Grammar, grammar, terminal
from bim_verify.core.facade.records import FacadeBox
from bim_verify.core.jobs.facade import FacadeOptions, facade

from .facade_data import photo_of

Given = list[tuple[str, tuple[float, float, float, float]]]
TOKEN = re.compile(r"split\([xz]\)|~?\d+\.\d+|\}\*\d+|[A-Za-z]+\d*|[{}|:]")


def read_text(text: str, width: float, height: float) -> Given:
    """What the written grammar says, without the code that wrote it."""
    rules = dict(line.split(" -> ", 1) for line in text.splitlines())

    def parts_of(tokens: list[str]) -> list[tuple[bool, float, list[str], int]]:
        out, k = [], 0
        while k < len(tokens):
            count, begin = 1, k
            if tokens[k] == "{":
                begin = k + 1
            depth, end = 0, begin
            while end < len(tokens) and (depth or (tokens[end] != "|" and not tokens[end].startswith("}*"))):
                depth += (tokens[end] == "{") - (tokens[end] == "}")
                end += 1
            inside = tokens[begin:end]
            if end < len(tokens) and tokens[end].startswith("}*"):
                count, end = int(tokens[end][2:]), end + 1
            assert inside[1] == ":"
            out.append((inside[0][0] == "~", float(inside[0].lstrip("~")), inside[2:], count))
            k = end + 1
        return out

    def grow(tokens: list[str], rect: tuple[float, float, float, float]) -> Given:
        name = tokens[0]
        if not name.startswith("split"):
            return grow(TOKEN.findall(rules[name]), rect) if name in rules else [] if name == "Wall" else [(name, rect)]
        k, parts = "xz".index(name[6]), parts_of(tokens[2:-1])
        fixed = sum(s * n for relative, s, _, n in parts if not relative)
        free = sum(s * n for relative, s, _, n in parts if relative)
        out, at = [], rect[k]
        for relative, size, inside, count in parts:
            size *= (rect[k + 2] - rect[k] - fixed) / free if relative else 1.0
            for _ in range(count):
                low, high = list(rect[:2]), list(rect[2:])
                low[k], high[k] = at, at + size
                out += grow(inside, (low[0], low[1], high[0], high[1]))
                at += size
        return out

    return grow(["Facade"], (0.0, 0.0, width, height))


def check(made: Grammar, boxes: list[FacadeBox], tolerance: float) -> None:
    given = read_text(made.text(), *made.size)
    assert sorted(n for n, _ in given) == sorted(terminal(b) for b in boxes)
    for box in boxes:
        wanted = np.array([box.x0, box.z0, box.x1, box.z1])
        assert min(np.abs(wanted - r).max() for n, r in given if n == terminal(box)) < tolerance


def regular(columns: int = 5, floors: int = 4, jitter: float = 0.0) -> list[FacadeBox]:
    off = np.random.default_rng(8).uniform(-jitter, jitter, (floors, columns, 4))
    return [
        FacadeBox(*(np.array([1.0 + 2.4 * i, 0.9 + 3.0 * k, 2.1 + 2.4 * i, 2.3 + 3.0 * k]) + off[k, i]), "window")
        for k in range(floors) for i in range(columns)
    ]  # fmt: skip


def test_equal_floors_of_equal_tiles_are_repeats() -> None:
    boxes = regular()
    made = grammar(boxes, (0.0, 3.0, 6.0, 9.0), 12.7, 12.0)
    assert made.text().splitlines() == [
        "Facade -> split(z) { { 3.000 : Floor1 }*4 }",
        "Floor1 -> split(x) { ~0.350 : Wall | { 2.400 : Tile1 }*5 | ~0.350 : Wall }",
        "Tile1 -> split(x) { ~0.650 : Wall | 1.100 : split(z) { ~0.900 : Wall | 1.400 : Window1 | ~0.700 : Wall } | "
        "~0.650 : Wall }",
    ]
    assert made.largest_error < 1e-6
    check(made, boxes, 0.002)


def test_measured_elements_come_back_within_the_tolerance() -> None:
    boxes = regular(jitter=0.03)
    boxes[2] = FacadeBox(5.5, 0.0, 7.0, 2.2, "door", 0.4, 1)
    made = grammar(boxes, (0.0, 3.0, 6.0, 9.0), 12.7, 12.0)
    assert "}*" in made.text()
    assert made.largest_error <= TOLERANCE_M
    check(made, boxes, TOLERANCE_M + 0.01)


def test_an_element_across_floors_and_two_above_one_another() -> None:
    boxes = [
        FacadeBox(1.0, 0.9, 2.0, 2.2, "window"), FacadeBox(4.0, 2.0, 5.0, 5.0, "window", type=1),
        FacadeBox(1.2, 4.0, 2.0, 5.2, "window", type=2), FacadeBox(1.0, 6.9, 2.0, 8.0, "window"),
    ]  # fmt: skip
    made = grammar(boxes, (0.0, 3.0, 6.0), 6.0, 9.0)
    assert made.text().splitlines()[0] == "Facade -> split(z) { 6.000 : Floor1 | 3.000 : Floor2 }"
    check(made, boxes, 0.002)


def test_what_no_cut_parts_is_left_out_and_named() -> None:
    boxes = [
        FacadeBox(0.0, 0.0, 2.0, 1.0, "window"), FacadeBox(2.0, 0.0, 3.0, 2.0, "window", type=1),
        FacadeBox(1.0, 2.0, 3.0, 3.0, "window"), FacadeBox(0.0, 1.0, 1.0, 3.0, "window", type=1),
        FacadeBox(4.0, 1.0, 5.0, 2.0, "window"), FacadeBox(4.0, 1.0, 5.0, 2.0, "window"),
    ]  # fmt: skip
    made = grammar(boxes, (0.0,), 6.0, 3.0)
    assert len(made.left_out) == 4
    assert len(made.boxes()) == 2
    assert made.largest_error < 0.001


@pytest.mark.parametrize("seed", [1, 3, 5, 7, 9, 11])
def test_a_facade_that_was_read_comes_back(seed: int, tmp_path: Path) -> None:
    photo = photo_of(tmp_path, seed)
    (found,) = facade([photo.path], FacadeOptions(corners=(photo.corners,), width=photo.plan.width))
    made = grammar(found.boxes, found.levels, found.scale.width, found.scale.height)
    assert not made.left_out
    assert made.largest_error <= TOLERANCE_M
    check(made, list(found.boxes), TOLERANCE_M + 0.01)


def test_a_wall_without_elements() -> None:
    assert grammar([], (0.0,), 6.0, 3.0).boxes() == []
