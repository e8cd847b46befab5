"""Some elements only: the same verdicts on them from a part of the work, and everything else still hides and explains."""

from __future__ import annotations

import numpy as np
import pytest

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.jobs.asked import ONE_IN, narrowed
from bim_verify.core.model.sample_surface import sample_surface
from bim_verify.core.results import VerificationResult
from bim_verify.core.simulation.box_building import ArraySource

from .verify_data import REMOVED, built, by_name, house, scan, shifted, verified

EDITS = {"cupboard": REMOVED, "ceiling": REMOVED, "column": shifted(0.04), "plate": shifted(0.0, 0.0, 0.03)}
CASES = ("column", "plate", "cupboard", "post", "valve")


@pytest.fixture(scope="module")
def source() -> ArraySource:
    return scan(built(EDITS))


@pytest.fixture(scope="module")
def everything(source: ArraySource) -> VerificationResult:
    return verified(source)


@pytest.mark.parametrize("name", CASES)
def test_an_element_alone_gets_the_verdict_it_gets_among_all(
    name: str, source: ArraySource, everything: VerificationResult
) -> None:
    whole = by_name(everything)[name]
    alone = by_name(verified(source, only=(whole.global_id,)))[name]
    assert alone.status == whole.status
    assert alone.achieved_loa == whole.achieved_loa
    assert (alone.displacement is None) == (whole.displacement is None)
    if alone.displacement is not None and whole.displacement is not None:
        assert alone.displacement == pytest.approx(whole.displacement, abs=0.0005)
    assert alone.registration_sigma == pytest.approx(whole.registration_sigma, abs=0.0005)


def test_far_elements_keep_a_share_of_their_positions() -> None:
    model = house()
    samples = sample_surface(model, 0.2)
    valve = next(k for k, e in enumerate(model.elements) if e.name == "valve")
    left = narrowed(model, samples, {model.elements[valve].global_id})
    count = {
        e.name: (int(samples.exposed[samples.element == k].sum()), int(left.exposed[samples.element == k].sum()))
        for k, e in enumerate(model.elements)
    }
    assert count["valve"][1] == count["valve"][0]
    assert count["north"][1] == count["north"][0]
    for far in ("west", "column", "plate", "cupboard"):
        assert count[far][1] == pytest.approx(count[far][0] / ONE_IN, abs=1)
    assert not np.any(left.exposed & ~samples.exposed)
    assert narrowed(model, samples, ()) is samples


def test_an_unknown_element_is_refused(source: ArraySource) -> None:
    with pytest.raises(BimVerifyError, match="None of the elements"):
        verified(source, only=("nothing",))
