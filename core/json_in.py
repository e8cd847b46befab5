"""JSON files that people and other programs hand in."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from .errors import BimVerifyError


def read_json(source: Path, what: str, largest: int) -> Any:
    """The content of a JSON file of at most ``largest`` bytes.

    Raises BimVerifyError, whose sentence says ``what`` the file should be.
    """
    try:
        if source.stat().st_size > largest:
            raise BimVerifyError(f"{source} is too large for {what} ({largest >> 20} MB is the most).")
        return json.loads(source.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise BimVerifyError(f"Cannot read {source}: {error.strerror or error}. Check the path.") from error
    except (ValueError, RecursionError) as error:
        raise BimVerifyError(f"{source} is no JSON file that can be read ({str(error)[:80]}). Write it again.") from error


def read_json_object(source: Path, what: str, largest: int) -> dict[str, Any]:
    """``read_json`` of a file that must hold an object."""
    content = read_json(source, what, largest)
    if not isinstance(content, dict):
        raise BimVerifyError(f"{source} is not {what}: it must hold one JSON object.")
    return content
