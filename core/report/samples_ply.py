"""The query positions with their evidence, as a PLY point cloud that any viewer opens."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..results import VerificationResult
from ..scans.write_ply import write_ply
from .palette import belief_color, to_bytes


def write_samples(path: str | Path, result: VerificationResult) -> None:
    """Write all samples: place and normal (model frame, metres), belief colour, masses, deviation and its sigma [m].

    ``deviation`` and ``sigma`` are NaN where nothing was measured; ``element`` is the row of ``elements`` in the JSON
    file. Raises BimVerifyError when ``path`` cannot be written; nothing is left behind then.
    """
    samples, evidence = result.samples, result.evidence
    position = samples.position + result.model.origin
    color = to_bytes(belief_color(evidence.m_occ, evidence.m_emp, evidence.m_unk))
    fields: dict[str, NDArray[Any]] = {name: position[:, axis] for axis, name in enumerate(("x", "y", "z"))}
    fields |= {name: samples.normal[:, axis] for axis, name in enumerate(("nx", "ny", "nz"))}
    fields |= {name: color[:, axis] for axis, name in enumerate(("red", "green", "blue"))}
    fields |= {
        name: getattr(evidence, name).astype("f4")
        for name in ("m_occ", "m_emp", "m_unk", "conflict", "deviation", "sigma")
    }
    fields["element"] = samples.element.astype("i4")
    write_ply(path, fields, ["metres, model frame", "element: row of the elements in the JSON file"])
