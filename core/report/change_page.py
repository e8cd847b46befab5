"""The report of a comparison: one HTML page in the frame of the verification report, and the table as CSV."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

from ..change.results import PROGRESS, STATES, ChangeResult, EpochRecord, GroupProgress, State
from ..files import make_folder, whole_file
from ..progress import Progress
from ..sensing.loa import label, supported_level, worst_voxel_shift
from . import palette
from .change_files import changes_csv
from .change_views import voxel_views
from .html import TABLE, format_number, format_percent
from .page_frame import PAGE, policy_hash, source, templates
from .remaining_view import remaining_views

SIGNS: dict[State, str] = {"CONFIRMED": "✓", "NEW": "+", "DISAPPEARED": "✕", "PARTIAL": "◐", "UNKNOWN": "?"}
ORDER: tuple[State, ...] = ("DISAPPEARED", "NEW", "PARTIAL", "UNKNOWN", "CONFIRMED")
MOST_CLUSTERS = 40


def write_change_report(folder: str | Path, result: ChangeResult, *, progress: Progress | None = None) -> Path:
    """Write ``index.html`` and ``elements.csv`` into ``folder`` (made if missing) and return the path of the page.

    The page loads nothing and runs no script. Raises BimVerifyError when the folder cannot be written.
    """
    target = make_folder(folder)
    page = render_change_page(result)
    with whole_file(target / PAGE) as temporary:
        temporary.write_text(page, encoding="utf-8", errors="replace")
    with whole_file(target / TABLE) as temporary:
        temporary.write_bytes(changes_csv(result))
    (progress or Progress()).update(1.0, "Report written")
    return target / PAGE


def render_change_page(result: ChangeResult) -> str:
    """The whole page as text."""
    style = _colors() + source("page.css", "change.css")
    environment = templates()
    environment.filters |= {"pct": format_percent, "number": format_number}
    series = list(result.series)
    rows = sorted(
        zip(result.elements, result.planned, strict=True), key=lambda p: (ORDER.index(p[0].state), -p[0].volume)
    )
    return environment.get_template("change.html").render(
        style=style,
        style_hash=policy_hash(style),
        r=result,
        rows=rows,
        states=[
            {"key": s, "sign": SIGNS[s], "meaning": palette.CHANGE_MEANINGS[s], "count": result.count(s)} for s in STATES
        ],
        signs=SIGNS,
        headline=headline(result),
        places=result.places(),
        files={
            "model": Path(result.model.path).name,
            "epoch": ", ".join(dict.fromkeys(Path(p).name for p in result.epoch.paths)),
            "reference": ", ".join(dict.fromkeys(Path(p).name for p in result.reference.paths))
            if result.reference else "the model itself",
        },
        views=voxel_views(result),
        shapes=remaining_views(result),
        series=series,
        series_counts=[[sum(v == s for v in epoch.states) for s in STATES] for epoch in series],
        clusters=result.clusters[:MOST_CLUSTERS],
        cluster_total=len(result.clusters),
        by_id={e.global_id: e for e in result.elements},
        progress=[(p, sum(e.progress == p for e in result.elements)) for p in PROGRESS],
        has_plan=any(p.act or p.source for p in result.planned),
        progress_series=_progress_series(series),
        level=label(supported_level(result.edge)),
        relative_level=label(supported_level(result.edge, relative=True)),
        worst_mm=1000 * worst_voxel_shift(result.edge),
        csv=base64.b64encode(changes_csv(result)).decode("ascii"),
    )


def _progress_series(series: list[EpochRecord]) -> list[tuple[str, str, list[GroupProgress | None]]]:
    """Kind, name and progress at each epoch, of every group."""
    known = [{(g.kind, g.name): g for g in epoch.progress} for epoch in series]
    groups = dict.fromkeys(key for epoch in reversed(known) for key in epoch)
    return [(kind, name, [epoch.get((kind, name)) for epoch in known]) for kind, name in groups]


def headline(result: ChangeResult) -> str:
    """The result in one or two sentences."""
    count = {s: result.count(s) for s in STATES}
    seen = len(result.elements) - count["UNKNOWN"]
    found: list[str] = []
    for state, word in (("DISAPPEARED", "gone"), ("NEW", "new"), ("PARTIAL", "changed in part")):
        if count[state]:  # type: ignore[index]
            found.append(f"{count[state]} {word}")  # type: ignore[index]
    changed = ", ".join(found) if found else "no element changed"
    return (
        f"Of {seen} elements that were decided, {count['CONFIRMED']} stand as before; {changed}. "
        f"{count['UNKNOWN']} could not be decided."
    )


def _colors() -> str:
    same: dict[str, Any] = {f"--{s.lower()}": code for s, code in palette.STATUS_HEX.items()}
    same |= {f"--b-{name}": code for name, code in palette.BELIEF_HEX.items()}
    same |= {f"--c-{s.lower()}": code for s, code in palette.CHANGE_HEX.items()}
    return ":root{" + ";".join(f"{name}:{code}" for name, code in same.items()) + "}\n"
