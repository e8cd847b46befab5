"""Does the as-built evidence confirm each element: the step, its colours, its numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.report import palette
from ...core.results import LEVELS, VerificationResult
from .. import project, verdicts
from .. import scene as scenery
from ..capability import Capability, Step, StepState
from ..colors import Category, Legend, Mode, Surface, categorical, ramp
from ..step_parts import main_button, missing, registration
from ..text import millimetres, percent, signed_millimetres

LOA_COLORS: dict[str, palette.RGB] = {
    "LOA50": (0.00, 0.27, 0.35),
    "LOA40": (0.00, 0.42, 0.46),
    "LOA30": (0.21, 0.60, 0.51),
    "LOA20": (0.55, 0.77, 0.50),
    "LOA10": (0.93, 0.87, 0.47),
    "NONE": (0.71, 0.07, 0.24),
}
LOA_MEANINGS = {
    "LOA50": "Within 1 mm (95 %)",
    "LOA40": "Within 5 mm (95 %)",
    "LOA30": "Within 15 mm (95 %)",
    "LOA20": "Within 5 cm (95 %)",
    "LOA10": "Within 15 cm (95 %)",
    "NONE": "Beyond 15 cm, or not where it was planned",
}


def _state(scene: bpy.types.Scene) -> StepState:
    settings = scene.bim_verify
    if verdicts.verified(scene):
        return StepState(True, settings.result_summary)
    return StepState(False, missing(scene) or "Ready")


def _draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify
    column = layout.column(align=True)
    column.prop(settings, "loa")
    column.prop(settings, "sigma_mm")
    column.prop(settings, "selected_only")
    main_button(layout, "verify", "VIEWZOOM")


def _expert(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.bim_verify
    registration(layout, settings)
    for name in ("spacing_mm", "fusion", "preset", "threads", "memory_gb", "display_vertices"):
        layout.prop(settings, name)


def _loa(item: bpy.types.Object) -> str:
    verdict = item.bim_verify
    return verdict.status if verdict.status in ("", "NOTOBSERVED") else verdict.achieved_loa


def _belief(surface: Surface, _scene: bpy.types.Scene) -> NDArray[np.float64]:
    return palette.belief_color(surface("bv_occupied"), surface("bv_empty"), surface("bv_unknown"))


def _deviation_range(scene: bpy.types.Scene) -> tuple[float, float]:
    reach = scene.bim_verify.deviation_range_mm / 1000
    return -reach, reach


def _coverage(surface: Surface) -> NDArray[np.float32]:
    return np.full(len(surface), surface.item.bim_verify.coverage, dtype=np.float32)


MODES: tuple[Mode, ...] = (
    categorical(
        "STATUS",
        "Status",
        "The verdict on the whole element",
        tuple(
            Category(status, label, palette.STATUS_MEANINGS[status], palette.STATUS_COLORS[status])
            for status, label in palette.STATUS_LABELS.items()
        ),
        verdicts.status,
    ),
    Mode(
        "BELIEF",
        "Evidence",
        "Where the scans say occupied, empty or nothing, mixed in proportion",
        _belief,
        lambda _: Legend(tuple((name.capitalize(), color) for name, color in palette.BELIEF_COLORS.items())),
        lambda item: bool(item.bim_verify.status),
    ),
    ramp("OCCUPIED", "Belief occupied", "How far the scans prove that the surface is there", "bv_occupied", unit="%"),
    ramp("EMPTY", "Belief empty", "How far the scans prove that nothing is there", "bv_empty", unit="%"),
    ramp("UNKNOWN", "Belief unknown", "How much the scans leave open: nothing seen there", "bv_unknown", unit="%"),
    ramp(
        "DEVIATION",
        "Deviation",
        "Signed distance of the scan from the planned surface, along its outward normal; of moved elements, the shift",
        "bv_deviation",
        unit="mm",
        span=_deviation_range,
        stops=palette.DEVIATION_STOPS,
        nothing="Not measured",
    ),
    categorical(
        "LOA",
        "Level reached",
        "The level of accuracy that the element reaches",
        (
            *(Category(level, level.replace("NONE", "None"), LOA_MEANINGS[level], c) for level, c in LOA_COLORS.items()),
            Category("NOTOBSERVED", "Not observed", palette.STATUS_MEANINGS["NOTOBSERVED"], palette.UNMEASURED),
        ),
        _loa,
    ),
    ramp("COVERAGE", "Coverage", "Share of the element's surface with evidence", _coverage, unit="%"),
)


def _numbers(item: bpy.types.Object) -> list[tuple[str, str]]:
    verdict = item.bim_verify
    if not verdict.status:
        return []
    shift = millimetres(verdict.displacement)
    if verdict.displacement == verdict.displacement:
        shift += f" ± {millimetres(1.96 * verdict.displacement_sigma)}"
        shift += ", significant" if verdict.significant else ", not significant"
    place = " at its planned place" if verdict.status == "DEVIATING" else ""
    confirmed = dict(zip(LEVELS, verdict.confirmed_ratio, strict=True))[int(verdict.required_loa.removeprefix("LOA"))]
    decided = []
    if verdict.decided_status:
        decided = [
            ("Decided", palette.STATUS_LABELS.get(verdict.decided_status, "")),
            ("By", f"{verdict.decided_by or 'a person'}, {verdict.decided_on}"),
        ]
    return [
        *decided,
        ("Verdict", palette.STATUS_LABELS[verdict.status]),
        ("Level", f"{verdict.achieved_loa} of {verdict.required_loa}"),
        (f"Coverage{place}", percent(verdict.coverage)),
        ("Occupied", percent(verdict.belief_occupied)),
        ("Empty", percent(verdict.belief_empty)),
        ("Unknown", percent(verdict.belief_unknown)),
        ("Conflict", percent(verdict.conflict)),
        (f"Within {verdict.required_loa}{place}", percent(confirmed)),
        ("Median deviation", signed_millimetres(verdict.deviation_median)),
        ("95 % deviation", millimetres(verdict.deviation_p95)),
        ("Shift", shift),
        ("Measurement sigma", millimetres(verdict.measurement_sigma)),
        ("Registration sigma", millimetres(verdict.registration_sigma)),
        ("Samples", f"{verdict.observed_count} of {verdict.sample_count} with a measured surface"),
        ("Seen by", verdict.stations),
    ]


def _brief(item: bpy.types.Object, vertex: int) -> list[str]:
    verdict = item.bim_verify
    if not verdict.status:
        return []
    decided = f" (decided; computed {palette.STATUS_LABELS[verdict.status].lower()})" if verdict.decided_status else ""
    said = [f"{palette.STATUS_LABELS[verdicts.status(item)]}{decided}, {verdict.achieved_loa} of {verdict.required_loa}"]
    if (here := _here(item, vertex)) is not None:
        said.append(here)
    if verdict.deviation_median == verdict.deviation_median:
        said.append(
            f"Median deviation {signed_millimetres(verdict.deviation_median)}, sigma {millimetres(verdict.measurement_sigma)}"
        )
    if verdict.displacement == verdict.displacement:
        word = "significant" if verdict.significant else "not significant"
        said.append(f"Shift {millimetres(verdict.displacement)} ± {millimetres(1.96 * verdict.displacement_sigma)}, {word}")
    return [*said, _why(item)]


def _here(item: bpy.types.Object, vertex: int) -> str | None:
    """What the scans say at one vertex of the surface."""
    attributes = item.data.attributes
    if vertex < 0 or "bv_occupied" not in attributes:
        return None
    names = ("occupied", "empty", "unknown")
    belief = ", ".join(f"{percent(attributes[f'bv_{name}'].data[vertex].value)} {name}" for name in names)
    measured = attributes["bv_deviation"].data[vertex].value
    deviation = f"{signed_millimetres(measured)}; " if measured == measured else ""
    return f"Here: {deviation}{belief}"


def _why(item: bpy.types.Object) -> str:
    stored = item.bim_verify
    return f"Decided: {stored.decision_reason}\nComputed: {stored.reason}" if stored.decided_status else stored.reason


def show(scene: bpy.types.Scene, result: Any) -> bool:
    """Fill an empty scene with a verification."""
    if not isinstance(result, VerificationResult):
        return False
    from ..surface_grid import make_display

    settings = scene.bim_verify
    display = make_display(result, settings.display_vertices)
    settings.model_path = str(Path(result.model.path).resolve())
    settings.model_summary, settings.edited_model = project.in_words(result.model), result.model.content_hash
    for path in (*result.scan_paths, *result.options.dense):
        entry = settings.scans.add()
        entry.path, entry.name = str(Path(path).resolve()), Path(path).name
        entry.dense = path in result.options.dense
        entry.points, entry.stations = project.points_and_stations(path, result.options)
    project.take_options(settings, result.options)
    project.adopt_frame(scene, result.model)
    scenery.show_result(scene, result, display)
    verdicts.store_all(scene, result)
    return True


CAPABILITY = Capability(
    "verify",
    Step("verify", "Verify", _state, _draw, _expert),
    MODES,
    numbers=_numbers,
    brief=_brief,
    why=_why,
    forget=verdicts.forget,
    show=show,
)
