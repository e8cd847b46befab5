"""How right are the causes of missing area on a simulated campaign, whose truth is known?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..simulation.campaign import Campaign
from ..simulation.missing_truth import NAMES, missing_truth
from .json_out import sample_causes
from .results import QualityResult

OCCLUDED = "occluded"


@dataclass(frozen=True)
class CauseScore:
    """Areas in m2."""

    missing: float
    """Not seen in truth or not seen as told."""
    right: float
    """Of that, with the right cause."""
    hidden: float
    """Told and truly occluded."""
    named: float
    """Of that, the named object is what stands between the named station and the place."""
    agreed: float
    """Share of the exposed surface for which seen or not seen is right."""
    confusion: tuple[tuple[str, str, float], ...]
    """(truth, told, area), largest errors first."""


def score_causes(result: QualityResult, campaign: Campaign) -> CauseScore:
    """Compare every exposed sample with the truth; elements that were built elsewhere than planned are left out."""
    samples = result.samples
    shifted = [row for row, edit in campaign.edits.items() if edit.kind == "shift"]
    judged = ~np.isin(samples.element[samples.exposed], shifted)
    rows = np.flatnonzero(samples.exposed)[judged]
    truth = missing_truth(campaign, samples.position[rows], samples.normal[rows], samples.element[rows])
    told = np.array(sample_causes(result))[judged]
    true = np.array(NAMES)[truth.cause]
    area = samples.area[rows]
    missing = (true != "seen") | (told != "seen")
    right = missing & (true == told)
    hidden = right & (told == OCCLUDED)
    station = result.survey.best.station[rows]
    blocker = truth.blocker[np.maximum(station, 0), np.arange(len(rows))]
    element, thing = result.blocked.element[rows], result.blocked.clutter[rows]
    count = len(campaign.model.elements)
    named = hidden & np.where(element >= 0, blocker == element, (thing >= 0) & (blocker >= count))
    pairs, inverse = np.unique(np.column_stack([true[missing & ~right], told[missing & ~right]]), axis=0, return_inverse=True)
    wrong = np.bincount(inverse.ravel(), weights=area[missing & ~right], minlength=len(pairs))
    order = np.argsort(-wrong)
    return CauseScore(
        missing=float(area[missing].sum()), right=float(area[right].sum()), hidden=float(area[hidden].sum()),
        named=float(area[named].sum()),
        agreed=float(area[(true == "seen") == (told == "seen")].sum() / max(area.sum(), 1e-12)),
        confusion=tuple((str(pairs[k][0]), str(pairs[k][1]), float(wrong[k])) for k in order),
    )
