"""Work on the selected elements only."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import bpy

from ..core.results import VerificationResult
from . import bonsai
from .scene import GUID_KEY


def global_ids(context: bpy.types.Context) -> set[str]:
    """GlobalIds of the selected elements: our objects or Bonsai's."""
    found = {item.get(GUID_KEY) or bonsai.global_id(item) for item in context.selected_objects}
    return {identifier for identifier in found if isinstance(identifier, str)}


def merged(
    new: VerificationResult, earlier: VerificationResult | None, only: Collection[str] | None
) -> VerificationResult:
    """The new verdicts of the elements ``only``, and for the others those of an earlier result of the same model."""
    if only is None or earlier is None or earlier.model.content_hash != new.model.content_hash:
        return new
    before = {verdict.global_id: verdict for verdict in earlier.verdicts}
    verdicts = tuple(v if v.global_id in only else before.get(v.global_id, v) for v in new.verdicts)
    return replace(new, verdicts=verdicts)
