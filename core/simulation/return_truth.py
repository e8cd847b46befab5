"""The truth of every simulated return, as columns of the E57 file in an extension of our own.

``bv:owner`` (row of the list of owners: the model's elements, then what else stands about), ``bv:mixed`` (1 where the
range mixes surfaces), ``bv:trueRange`` (metres along the beam's centre, before noise). Readers that do not know the
extension skip it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..scans.e57_header import read_headers
from ..scans.e57_pages import E57Pages
from ..scans.e57_records import read_records
from ..scans.write_e57 import extension_uri
from .scanner import SimulatedReturns

OWNER, MIXED, TRUE_RANGE = "bv:owner", "bv:mixed", "bv:trueRange"


def truth_columns(returns: SimulatedReturns) -> dict[str, NDArray]:
    """Columns for ``ReturnBlock.extra``."""
    return {
        OWNER: returns.owner.astype(np.int32), MIXED: returns.mixed.astype(np.int32),
        TRUE_RANGE: returns.true_range.astype(np.float32),
    }


def read_truth(path: str | Path, station: int) -> dict[str, NDArray]:
    """The truth columns of one station of an E57 that was simulated. Raises BimVerifyError where it has none."""
    with E57Pages(Path(path)) as pages:
        headers = read_headers(pages)
        if not 0 <= station < len(headers):
            raise BimVerifyError(f"{path} has {len(headers)} stations, so there is no station {station}.")
        records = headers[station].records
        names = {name: f"{{{extension_uri('bv')}}}{name.removeprefix('bv:')}" for name in (OWNER, MIXED, TRUE_RANGE)}
        if not all(name in records for name in names.values()):
            raise BimVerifyError(f"{path} carries no truth of its returns; simulate it with bim-verify.")
        parts: dict[str, list[NDArray]] = {name: [] for name in names}
        for block in read_records(pages, records, list(names.values()), 262_144):
            for name, field in names.items():
                parts[name].append(np.array(block[field]))
    return {name: np.concatenate(values) for name, values in parts.items()}
