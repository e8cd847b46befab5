"""Work on the selected elements only."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import bpy
import numpy as np

from ..core.errors import BimVerifyError
from ..core.model.elements import BuildingModel
from ..core.options import VerifyOptions
from ..core.results import SampleEvidence, VerificationResult
from . import bonsai
from .scene import GUID_KEY, key_of


def global_ids(context: bpy.types.Context) -> set[str]:
    """GlobalIds of the selected elements: our objects or Bonsai's."""
    return _of_selected(context, lambda item: item.get(GUID_KEY))


def keys(context: bpy.types.Context) -> set[str]:
    """What ``scene.element_objects`` calls the selected elements."""
    return _of_selected(context, key_of)


def _of_selected(context: bpy.types.Context, name: Callable[[bpy.types.Object], str | None]) -> set[str]:
    found = {name(item) or bonsai.global_id(item) for item in context.selected_objects}
    return {identifier for identifier in found if isinstance(identifier, str)}


def chosen(context: bpy.types.Context, selected_only: bool) -> set[str] | None:
    """GlobalIds of the selection where only that is asked for, else None: all. Raises BimVerifyError when it is empty."""
    if not selected_only:
        return None
    found = global_ids(context)
    if not found:
        raise BimVerifyError("No element is selected. Select some, or turn off 'Selected elements only'.")
    return found


def comparable(new: BuildingModel, options: VerifyOptions, earlier: VerificationResult | None) -> bool:
    """Whether a verification of some elements can be put into an earlier result: same model, same query positions."""
    return (
        earlier is not None
        and earlier.model.content_hash == new.content_hash
        and earlier.options.sample_spacing == options.sample_spacing
    )


def merged(
    new: VerificationResult, earlier: VerificationResult | None, only: Collection[str] | None
) -> VerificationResult:
    """Verdicts and evidence of the elements ``only`` from ``new``, those of the others from ``earlier`` if it fits."""
    if only is None or earlier is None or not comparable(new.model, new.options, earlier):
        return new
    before = {verdict.global_id: verdict for verdict in earlier.verdicts}
    verdicts = tuple(v if v.global_id in only else before.get(v.global_id, v) for v in new.verdicts)
    ours = np.array([element.global_id in only for element in new.model.elements], dtype=np.bool_)[new.samples.element]
    evidence = SampleEvidence(**{
        name: np.where(ours, values, getattr(earlier.evidence, name)) for name, values in vars(new.evidence).items()
    })
    exposed = np.where(ours, new.samples.exposed, earlier.samples.exposed)
    samples = replace(new.samples, exposed=exposed)
    return replace(new, verdicts=verdicts, samples=samples, evidence=evidence, options=replace(new.options, only=()))
