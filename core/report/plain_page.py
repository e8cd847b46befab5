"""A report of sections, each with a text, a drawing and a table: one HTML file that loads nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from markupsafe import Markup

from ..files import make_folder, whole_file
from .page_frame import PAGE, policy_hash, source, templates


@dataclass(frozen=True)
class Section:
    """One section; all texts are escaped, a drawing is taken as it is."""

    title: str
    text: str = ""
    drawing: Markup | None = None
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    numeric: frozenset[int] = field(default_factory=frozenset)
    """Columns of numbers."""


def write_page(
    folder: str | Path, title: str, eyebrow: str, headline: str, meta: Sequence[tuple[str, str]],
    sections: Sequence[Section],
) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    target = make_folder(folder)
    style = source("page.css", "plain_page.css")
    page = templates().get_template("plain_page.html").render(
        title=title, eyebrow=eyebrow, headline=headline, meta=meta, sections=sections, style=style,
        style_hash=policy_hash(style),
    )
    with whole_file(target / PAGE) as temporary:
        temporary.write_text(page, encoding="utf-8", errors="replace")
    return target / PAGE


def millimetres(value: float | None, digits: int = 1) -> str:
    """Metres as millimetres; a dash where nothing is known."""
    return "–" if value is None else f"{1000 * value:z.{digits}f}"


def percent(value: float | None) -> str:
    """A share; a dash where nothing is known."""
    return "–" if value is None else f"{100 * value:z.0f} %"
