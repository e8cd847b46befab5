"""The query positions with their evidence, as a PLY point cloud that any viewer opens."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..files import whole_file
from ..results import VerificationResult
from .palette import belief_color, to_bytes

ROW = np.dtype(
    [(name, "<f8") for name in ("x", "y", "z", "nx", "ny", "nz")]
    + [(name, "u1") for name in ("red", "green", "blue")]
    + [(name, "<f4") for name in ("m_occ", "m_emp", "m_unk", "conflict", "deviation", "sigma")]
    + [("element", "<i4")]
)
PLY_TYPE = {"<f8": "double", "|u1": "uchar", "<f4": "float", "<i4": "int"}
BLOCK = 500_000
"""Samples written at once."""


def write_samples(path: str | Path, result: VerificationResult) -> None:
    """Write all samples: place and normal (model frame, metres), belief colour, masses, deviation and its sigma [m].

    ``deviation`` and ``sigma`` are NaN where nothing was measured; ``element`` is the row of ``elements`` in the JSON
    file. Raises BimVerifyError when ``path`` cannot be written; nothing is left behind then.
    """
    samples, evidence = result.samples, result.evidence
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        stream.write(_header(len(samples)))
        for begin in range(0, len(samples), BLOCK):
            part = slice(begin, begin + BLOCK)
            rows = np.empty(len(samples.element[part]), dtype=ROW)
            position = samples.position[part] + result.model.origin
            rgb = to_bytes(belief_color(evidence.m_occ[part], evidence.m_emp[part], evidence.m_unk[part]))
            for axis in range(3):
                rows["xyz"[axis]] = position[:, axis]
                rows[("nx", "ny", "nz")[axis]] = samples.normal[part, axis]
                rows[("red", "green", "blue")[axis]] = rgb[:, axis]
            for name in ("m_occ", "m_emp", "m_unk", "conflict", "deviation", "sigma"):
                rows[name] = getattr(evidence, name)[part]
            rows["element"] = samples.element[part]
            stream.write(rows.tobytes())


def _header(count: int) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", "comment metres, model frame", f"element vertex {count}"]
    lines += [f"property {PLY_TYPE[ROW[name].str]} {name}" for name in ROW.names or ()]
    return ("\n".join([*lines, "end_header"]) + "\n").encode("ascii")
