"""The part of a verification that is about some elements: for a report, a table or a check of a selection."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from .errors import BimVerifyError
from .model.part_of import part_of
from .results import SampleEvidence, VerificationResult


def of_elements(result: VerificationResult, global_ids: Collection[str]) -> VerificationResult:
    """The same result with the elements of these GlobalIds alone, and a warning that says so.

    Raises BimVerifyError when the result knows none of them.
    """
    model, rows, triangles = part_of(result.model, global_ids)
    if not len(rows):
        raise BimVerifyError("None of the selected elements was verified.")
    every = len(result.model.elements)
    new_row, new_triangle = np.full(every, -1, np.int32), np.full(len(result.model.triangles), -1, np.int32)
    new_row[rows], new_triangle[triangles] = np.arange(len(rows)), np.arange(len(triangles))
    samples = result.samples
    own = new_row[samples.element] >= 0
    verdicts = tuple(result.verdicts[row] for row in rows)
    known = {verdict.global_id for verdict in verdicts}
    return replace(
        result, model=model, verdicts=verdicts,
        samples=replace(
            samples, position=samples.position[own], normal=samples.normal[own], area=samples.area[own],
            element=new_row[samples.element[own]], triangle=new_triangle[samples.triangle[own]], exposed=samples.exposed[own],
        ),
        evidence=SampleEvidence(**{name: values[own] for name, values in vars(result.evidence).items()}),
        photos=tuple(photo for photo in result.photos if photo.global_id in known),
        decisions={key: said for key, said in result.decisions.items() if key in known},
        warnings=(*result.warnings, f"This holds for {len(rows)} of {every} elements, those that were selected."),
    )
