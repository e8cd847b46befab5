"""What every page of a report has: its folder, its templates, and a policy that lets it load nothing."""

from __future__ import annotations

import base64
import hashlib
from pathlib import Path

import jinja2

FOLDER = Path(__file__).parent
PAGE = "index.html"


def templates() -> jinja2.Environment:
    """The templates of this folder; every value is escaped, a missing one is an error."""
    return jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        loader=jinja2.FileSystemLoader(FOLDER),
    )


def source(*names: str) -> str:
    """Styles or scripts of this folder, one after the other."""
    return "".join((FOLDER / name).read_text(encoding="utf-8") for name in names)


def policy_hash(text: str) -> str:
    """What a content security policy names an inline style or script by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
