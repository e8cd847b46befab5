"""The report: one HTML file that needs no network, and the table beside it as CSV."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..dimensions.table import COLUMNS, NUMERIC, Dimension, shown
from ..files import make_folder, whole_file
from ..progress import Progress
from ..results import LEVELS, STATUSES, VerificationResult
from ..sensing.loa import UPPER_BOUND_M
from . import charts, palette
from .csv_out import elements_csv, write_csv
from .json_out import to_plain
from .page_frame import PAGE, policy_hash, source, templates
from .pictures import PICK_SCALE, SIZE, report_pictures
from .rows import ELEMENT_BINS, element_rows, group_counts, weighted_quantile

TABLE = "elements.csv"
"""What is in the folder of a report."""
SCAN_WORDS = {"scans": "Scans", "station": "station", "taken": "Scanned", "returns": "Returns"}
PHOTO_WORDS = {"scans": "Photos", "station": "camera", "taken": "Taken", "returns": "Rays"}
OPTION_LABELS = {
    "loa": "Level of accuracy asked for",
    "sigma": "Sigma of one return (m)",
    "registration_sigma": "Registration sigma (m)",
    "align": "Alignment",
    "sample_spacing": "Sample spacing (m)",
    "fusion": "Fusion rule",
    "preset": "Mass functions",
    "only": "Only the elements",
    "dense": "Dense points",
    "scan_frame": "Frame of the scans",
    "origin": "Scanner position given (m)",
    "threads": "Threads (0: all)",
    "memory_gb": "Memory limit (GB)",
    "cache": "Tessellation cache",
    "seed": "Seed",
}
POSE_AXES = ("Rotation x", "Rotation y", "Rotation z", "Shift x", "Shift y", "Shift z")


def write_report(
    folder: str | Path, result: VerificationResult, *, dimensions: Sequence[Dimension] = (), progress: Progress | None = None
) -> Path:
    """Write ``index.html`` and ``elements.csv`` into ``folder`` (made if missing) and return the path of the page.

    The page loads nothing: styles, script, pictures and the CSV are inside, and its content security policy allows
    nothing else. Raises BimVerifyError when the folder cannot be written.
    """
    progress = progress or Progress()
    target = make_folder(folder)
    page = render_page(result, dimensions=dimensions, progress=progress)
    with whole_file(target / PAGE) as temporary:
        temporary.write_text(page, encoding="utf-8", errors="replace")
    write_csv(target / TABLE, result)
    progress.update(1.0, "Report written")
    return target / PAGE


def render_page(
    result: VerificationResult, *, dimensions: Sequence[Dimension] = (), progress: Progress | None = None
) -> str:
    """The whole page as text."""
    progress = progress or Progress()
    limit = UPPER_BOUND_M[result.options.loa]
    rows, held = element_rows(result), result.as_decided()
    style = _colors_css() + source("page.css")
    script = source("page.js")
    environment = templates()
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "sort_keys": False, "separators": (",", ":")}
    environment.filters |= {"mm": format_mm, "pct": format_percent, "number": format_number}
    return environment.get_template("page.html").render(
        style=style,
        style_hash=policy_hash(style),
        script=script,
        script_hash=policy_hash(script),
        r=result,
        rows=rows,
        facts=_facts(result),
        statuses=[
            {"key": s, "label": palette.STATUS_LABELS[s], "sign": palette.STATUS_SIGNS[s],
             "meaning": palette.STATUS_MEANINGS[s], "count": held.count(s)}
            for s in STATUSES
        ],
        headline=headline(result),
        file_names=_file_names(result),
        words=PHOTO_WORDS if result.photos_only else SCAN_WORDS,
        pictures=report_pictures(held, limit, progress.part(0.1, 0.95)),
        picture_size=SIZE,
        deviation_stops=palette.DEVIATION_STOPS,
        limit_mm=limit * 1000.0,
        histogram=charts.deviation_histogram(result, limit),
        coverage=charts.coverage_chart(held),
        levels=charts.level_chart(result),
        by_class=group_counts(rows, lambda row: str(row["class"])),
        by_storey=group_counts(rows, lambda row: str(row["storey"] or "(no storey)"), 5),
        classes=sorted({row["class"] for row in rows}),
        storeys=sorted({row["storey"] for row in rows}),
        levels_asked=LEVELS,
        dimensions=shown(dimensions),
        dimension_columns=COLUMNS,
        dimension_numbers=NUMERIC,
        alignment=_alignment(result),
        options=[(OPTION_LABELS.get(k, k), _option_text(v)) for k, v in asdict(result.options).items()],
        csv=base64.b64encode(elements_csv(result)).decode("ascii"),
        data=to_plain(
            {"rows": rows, "levels": LEVELS, "bounds": [UPPER_BOUND_M[lv] * 1000.0 for lv in LEVELS],
             "bins": ELEMENT_BINS, "required": result.options.loa, "pickScale": PICK_SCALE,
             "stops": palette.DEVIATION_STOPS, "labels": palette.STATUS_LABELS, "signs": palette.STATUS_SIGNS}
        ),
    )  # fmt: skip


def headline(result: VerificationResult) -> str:
    """The result in two or three sentences: what holds, and how much of it a person decided."""
    held, overruled = result.as_decided(), result.summary()["overruled"]
    total, count = len(held.verdicts), {s: held.count(s) for s in STATUSES}
    first = f"{count['CONFIRMED']} of {total} elements are confirmed at LOA{result.options.loa}."
    trouble = []
    if count["DEVIATING"]:
        trouble.append(f"{count['DEVIATING']} {'deviates' if count['DEVIATING'] == 1 else 'deviate'}")
    if count["ABSENT"]:
        trouble.append(f"{count['ABSENT']} {'is' if count['ABSENT'] == 1 else 'are'} absent")
    open_ones = count["PARTIAL"] + count["NOTOBSERVED"]
    second = (" and ".join(trouble) + "." if trouble else "None deviates and none is absent.").capitalize()
    third = f" {open_ones} could not be decided for want of evidence." if open_ones else ""
    fourth = f" A person overruled {overruled} verdict{'s' if overruled > 1 else ''}." if overruled else ""
    return f"{first} {second}{third}{fourth}"


def format_mm(value: float | None, digits: int = 1, signed: bool = False) -> str:
    """Millimetres (given in millimetres) with a true minus sign; a dash where nothing is known."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:+.{digits}f}" if signed else f"{value:.{digits}f}"
    return ("0" if digits == 0 else f"{0:.{digits}f}") if float(text) == 0 else text.replace("-", "−")


def format_percent(share: float | None, digits: int = 0) -> str:
    """A share 0..1 as a percentage that is 100 or 0 only when it is all or nothing."""
    if share is None or not math.isfinite(share):
        return "–"
    step = 10.0**-digits
    value = 100.0 * share
    if 0.0 < share < 1.0:
        value = min(max(value, step), 100.0 - step)
    return f"{value:.{digits}f} %"


def format_number(value: float | int) -> str:
    """A count with thin spaces between thousands."""
    return f"{value:,.0f}".replace(",", "\u202f")


def _facts(result: VerificationResult) -> dict[str, Any]:
    deviation, area = result.evidence.deviation, result.samples.area
    median = weighted_quantile(np.abs(deviation), area, 0.5)
    p95 = weighted_quantile(np.abs(deviation), area, 0.95)
    registration = [s.registration_sigma for s in result.stations if math.isfinite(s.registration_sigma)]
    measurement = [v.measurement_sigma for v in result.verdicts if v.observed_count]
    return {
        "coverage": result.summary()["coverage"],
        "median": None if median is None else median * 1000.0,
        "p95": None if p95 is None else p95 * 1000.0,
        "registration": float(np.median(registration)) * 1000.0 if registration else None,
        "measurement": (float(np.median(measurement)) if measurement else result.options.sigma) * 1000.0,
        "returns": sum(s.returns for s in result.stations),
        "seconds": sum(result.timings.values()),
        "bound": UPPER_BOUND_M[result.options.loa] * 1000.0,
        "longest": max(result.timings.values(), default=0.0),
    }


def _file_names(result: VerificationResult) -> dict[str, str]:
    names = list(dict.fromkeys(Path(path).name for path in result.scan_paths))
    scans = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    return {"model": Path(result.model.path).name, "scans": scans}


def _alignment(result: VerificationResult) -> dict[str, Any]:
    record = result.alignment
    matrix = record.transform
    angle = math.degrees(math.acos(min(max((float(np.trace(matrix[:3, :3])) - 1.0) / 2.0, -1.0), 1.0)))
    sigmas = []
    if record.covariance is not None:
        spread = np.sqrt(np.maximum(np.diag(record.covariance), 0.0))
        unit = [math.degrees(s) * 3600.0 for s in spread[:3]] + [float(s) * 1000.0 for s in spread[3:]]
        sigmas = list(zip(POSE_AXES, unit, ["″"] * 3 + ["mm"] * 3, strict=True))
    return {
        "matrix": [[f"{value:.6f}".replace("-", "−") for value in row] for row in matrix.tolist()],
        "shift": float(np.linalg.norm(matrix[:3, 3])) * 1000.0,
        "angle": angle,
        "sigmas": sigmas,
        "rms": None if record.rms is None else record.rms * 1000.0,
        "inliers": record.inlier_ratio,
    }


def _option_text(value: Any) -> str:
    if value is None:
        return "estimated or not given"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ", ".join(v if isinstance(v, str) else f"{v:g}" for v in value) or "none"
    return str(value)


def _colors_css() -> str:
    pairs = [f"--{s.lower()}:{code}" for s, code in palette.STATUS_HEX.items()]
    pairs += [f"--b-{name}:{code}" for name, code in palette.BELIEF_HEX.items()]
    return ":root{" + ";".join(pairs) + "}\n"


