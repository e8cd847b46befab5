"""What evidence at its planned place says of an element."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bim_verify.core.change.verdict import verdict
from bim_verify.core.evidence.own_evidence import OwnEvidence
from bim_verify.core.evidence.thresholds import Thresholds


def says(
    at: float, either: float, beyond: float, beams_at: int, beams_through: int, seen_share: float = 0.5, glazed: bool = False,
    beams_either: int = 0, beams_split: int = 0,
) -> str:
    areas = [np.array([a]) for a in (at, either, beyond, 0.0)]
    own = OwnEvidence(*areas, *(np.array([n]) for n in (beams_at, beams_through, beams_either, beams_split)))
    return verdict(own, 0, seen_share, (0.25, 0.5), Thresholds(), glazed)


def test_what_stands_is_gone_or_stands_in_part() -> None:
    assert says(9.0, 0.0, 1.0, 90, 10) == "STANDS"
    assert says(1.0, 0.0, 9.0, 10, 90) == "GONE"
    assert says(4.0, 0.0, 6.0, 40, 60) == "PART"


def test_of_what_stands_a_part_is_gone_when_beams_show_that_more_than_a_quarter_passes() -> None:
    assert says(6.0, 0.0, 4.0, 60, 40) == "PART"
    assert says(6.0, 0.0, 4.0, 6, 4) == "STANDS", "few beams"
    assert says(6.0, 0.0, 4.0, 95, 5) == "STANDS", "most of these beams pass close to its edges"
    assert says(8.0, 0.0, 2.0, 800, 200) == "STANDS", "edges of slender elements let as many pass"
    assert says(6.0, 8.0, 4.0, 60, 40) == "STANDS", "another element may have the rest"
    assert says(6.0, 0.0, 4.0, 60, 40, glazed=True) == "STANDS"
    assert says(6.0, 0.0, 4.0, 60, 40, seen_share=0.04) == "STANDS"


@pytest.mark.parametrize("passes, expected", [(0.11, "GONE"), (0.09, "EITHER")])
def test_when_rays_pass_it_is_gone_but_not_when_they_are_less_than_a_tenth(passes: float, expected: str) -> None:
    """Another element has the rest of its surface; edges and recesses of a standing one let as many pass."""
    assert says(0.0, 1.0 - passes, passes, 0, 50) == expected


def test_it_stands_in_part_only_when_it_does_so_whosever_the_shared_surface_is() -> None:
    assert says(4.0, 0.5, 6.0, 400, 600) == "PART"
    assert says(4.0, 3.0, 6.0, 400, 600) == "EITHER", "with what is shared it would stand"


@pytest.mark.parametrize("beams, expected", [(20, "EITHER"), (200, "PART")])
def test_a_part_is_gone_when_enough_beams_show_that_less_than_half_of_it_is_there(beams: int, expected: str) -> None:
    """Four tenths of what was seen of it, by area: beams lie closer together on some faces than on others."""
    assert says(4.0, 0.0, 6.0, beams // 2, beams // 2) == expected
    assert says(3.6, 0.4, 6.0, beams // 2 - 1, beams // 2, beams_either=1) == expected


def test_beams_that_pass_where_it_may_stand_beside_do_not_show_that_it_or_a_part_is_gone() -> None:
    areas = [np.array([a]) for a in (0.1, 0.0, 0.9, 0.0)]
    own = OwnEvidence(*areas, *(np.array([n]) for n in (10, 90, 0, 0)))
    part = dataclasses.replace(own, at=np.array([0.4]), beyond=np.array([0.6]), beams_at=np.array([40]))
    for few, beside, expected in ((10, 0.1, "BESIDE"), (80, 0.9, None)):
        clear = {"beams_through": np.array([few]), "beyond": np.array([beside])}
        for whole, unless in ((own, "GONE"), (part, "PART")):
            clear_of = dataclasses.replace(whole, **clear)
            assert verdict(whole, 0, 0.5, (0.25, 0.5), Thresholds(), clear=clear_of) == (expected or unless)


def test_little_of_it_in_view_does_not_show_that_it_or_a_part_is_gone() -> None:
    assert says(1.0, 0.0, 9.0, 10, 90, seen_share=0.04) == "LITTLE"
    assert says(4.0, 0.0, 6.0, 40, 60, seen_share=0.04) == "LITTLE"
    assert says(9.0, 0.0, 1.0, 90, 10, seen_share=0.04) == "STANDS"


@pytest.mark.parametrize("own, expected", [(3, "EITHER"), (11, "STANDS")])
def test_a_sheet_before_a_wall_does_not_stand_by_the_scatter_of_the_wall_s_returns(own: int, expected: str) -> None:
    """One in twenty of a neighbour's returns lies farther than two sigmas from its face."""
    assert says(0.01, 0.6, 0.0, own, 0, beams_either=100) == expected


@pytest.mark.parametrize("split, expected", [(13, "EITHER"), (3, "GONE")])
def test_nothing_is_gone_while_as_many_beams_return_from_it_or_from_an_edge_before_it(split: int, expected: str) -> None:
    assert says(0.0, 1.0, 2.0, 0, 13, beams_either=split, beams_split=split) == expected


def test_few_beams_tell_nothing() -> None:
    assert says(0.0, 0.0, 1.0, 0, 4) == "FEW" and says(0.0, 0.0, 1.0, 0, 5) == "GONE"
    assert says(1.0, 0.0, 0.0, 2, 0) == "FEW" and says(1.0, 0.0, 0.0, 3, 0) == "STANDS"
    assert says(0.0, 1.0, 0.0, 0, 0) == "EITHER"
