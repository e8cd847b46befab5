"""The whole result, but the samples, as one JSON file for other tools. docs/json.md describes it."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..files import whole_file
from ..results import VerificationResult

FORMAT = "bim_verify.verification"
FORMAT_VERSION = 1


def result_to_json(result: VerificationResult) -> dict[str, Any]:
    """Plain lists, dicts, numbers, texts and None (never NaN). Lengths in metres, model frame, angles in radians.

    ``verdicts[i]`` belongs to ``elements[i]``, and to the samples whose ``element`` is i in the samples PLY. Verdicts are
    those that were computed; ``decisions`` says, by GlobalId, what a person put in their place.
    """
    model = result.model
    document = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "method": result.method,
        "summary": result.summary(),
        "model": {
            "path": model.path,
            "sha256": model.content_hash,
            "schema": model.schema,
            "project": model.project_name,
            "length_unit_m": model.length_unit_m,
            "origin": model.origin,
            "skipped": model.skipped,
        },
        "scans": {"paths": result.scan_paths, "date": result.scan_date, "dropped": result.dropped},
        "options": result.options,
        "elements": [verdict.global_id for verdict in result.verdicts],
        "verdicts": result.verdicts,
        "decisions": result.decisions,
        "stations": result.stations,
        "photos": result.photos,
        "alignment": result.alignment,
        "timings": result.timings,
        "warnings": result.warnings,
    }
    plain: dict[str, Any] = to_plain(document)
    return plain


def write_json(path: str | Path, result: VerificationResult) -> None:
    """Write ``result_to_json`` as strict JSON in ASCII; BimVerifyError when ``path`` cannot be written."""
    write_document(path, result_to_json(result))


def write_document(path: str | Path, document: dict[str, Any]) -> None:
    """Write what ``to_plain`` made as strict JSON in ASCII; BimVerifyError when ``path`` cannot be written."""
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(document, indent=1, allow_nan=False), encoding="ascii")


def to_plain(value: Any) -> Any:
    """Records, arrays and numpy numbers as what JSON knows; a number that is not finite becomes None."""
    if is_dataclass(value) and not isinstance(value, type):
        return to_plain(asdict(value))
    if isinstance(value, dict):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, np.generic):
        return to_plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    return value
