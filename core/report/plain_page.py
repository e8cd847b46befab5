"""A report of sections, each with a text, a drawing and a table: one HTML file that loads nothing."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import jinja2
from markupsafe import Markup

from ..errors import BimVerifyError
from ..files import whole_file

FOLDER = Path(__file__).parent
PAGE = "index.html"


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
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BimVerifyError(
            f"Cannot make the report folder {target}: {error.strerror or error}. Choose another place."
        ) from error
    style = "".join((FOLDER / name).read_text(encoding="utf-8") for name in ("page.css", "plain_page.css"))
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=jinja2.FileSystemLoader(FOLDER),
    )
    digest = base64.b64encode(hashlib.sha256(style.encode("utf-8")).digest()).decode("ascii")
    page = environment.get_template("plain_page.html").render(
        title=title, eyebrow=eyebrow, headline=headline, meta=meta, sections=sections, style=style,
        style_hash=f"sha256-{digest}",
    )
    with whole_file(target / PAGE) as temporary:
        temporary.write_text(page, encoding="utf-8", errors="replace")
    return target / PAGE


def millimetres(value: float | None, digits: int = 1) -> str:
    """Metres as millimetres; a dash where nothing is known."""
    return "–" if value is None else f"{1000 * value:.{digits}f}"


def percent(value: float | None) -> str:
    """A share; a dash where nothing is known."""
    return "–" if value is None else f"{100 * value:.0f} %"
