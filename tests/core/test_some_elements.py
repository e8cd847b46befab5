"""A part of a verification is one of its own: same verdicts and evidence, nothing of the others."""

from __future__ import annotations

from pathlib import Path

import ifcopenshell
import numpy as np
import pytest
from ifctester import ids

from bim_verify.core.errors import BimVerifyError
from bim_verify.core.exchange.ids import write_ids
from bim_verify.core.model.write_psets import write_verified_ifc
from bim_verify.core.results import VerificationResult
from bim_verify.core.some_elements import of_elements

from .factory import small_result


@pytest.fixture
def whole(tmp_path: Path) -> VerificationResult:
    return small_result(tmp_path)


def test_it_has_the_evidence_of_its_elements_alone(whole: VerificationResult) -> None:
    chosen = [whole.verdicts[k] for k in (1, 3)]
    part = of_elements(whole, {v.global_id for v in chosen})
    assert part.verdicts == tuple(chosen)
    assert [e.global_id for e in part.model.elements] == [v.global_id for v in chosen]
    for new, old in ((0, 1), (1, 3)):
        own, before = part.samples.element == new, whole.samples.element == old
        assert own.any() and np.array_equal(part.samples.position[own], whole.samples.position[before])
        assert np.array_equal(part.evidence.deviation[own], whole.evidence.deviation[before], equal_nan=True)
        corners = part.model.vertices[part.model.triangles[part.samples.triangle[own]]]
        assert np.array_equal(corners, whole.model.vertices[whole.model.triangles[whole.samples.triangle[before]]])
        assert (part.model.triangle_element[part.samples.triangle[own]] == new).all()
    assert "2 of 5 elements" in part.warnings[-1]


def test_an_ids_of_it_asks_nothing_of_the_others(whole: VerificationResult, tmp_path: Path) -> None:
    wall = next(v for v in whole.verdicts if v.ifc_class == "IfcWall")
    part = of_elements(whole, {wall.global_id})
    assert part.model.partly == ("IfcWall",)
    write_ids(tmp_path / "part.ids", part)
    write_verified_ifc(whole.model.path, part, tmp_path / "part.ifc")
    check = ids.open(str(tmp_path / "part.ids"))
    check.validate(ifcopenshell.open(str(tmp_path / "part.ifc")))
    given = next(s for s in check.specifications if s.name.startswith("Verification is given"))
    assert [e.GlobalId for e in given.applicable_entities] == [wall.global_id] and given.status


def test_none_of_them_is_refused(whole: VerificationResult) -> None:
    with pytest.raises(BimVerifyError, match="None of the selected"):
        of_elements(whole, {"nobody"})
