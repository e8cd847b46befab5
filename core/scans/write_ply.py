"""Write named columns as the vertices of a binary PLY file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..files import whole_file

_TYPES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint",
    "f4": "float", "f8": "double",
}
_ROWS = 262_144


def write_ply(path: str | Path, fields: Mapping[str, NDArray], comments: Sequence[str] = ()) -> None:
    """Write columns of equal length (N,) as vertex properties, binary little endian, in the order given.

    The array's type is the property's; bool becomes uchar and int64 becomes int (its values must fit). Raises
    ValueError on other types, lengths or names, BimVerifyError when the place cannot be written.
    """
    columns = {name: _plain(name, np.asarray(values)) for name, values in fields.items()}
    lengths = {len(values) for values in columns.values()}
    if len(lengths) != 1:
        raise ValueError("the columns of a PLY file must have one length")
    count = lengths.pop()
    dtype = np.dtype([(name, values.dtype.newbyteorder("<")) for name, values in columns.items()])
    header = ["ply", "format binary_little_endian 1.0"]
    header += ["comment " + " ".join(comment.split()) for comment in comments]
    header.append(f"element vertex {count}")
    header += [f"property {_TYPES[values.dtype.str[1:]]} {name}" for name, values in columns.items()]
    header.append("end_header")
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write(("\n".join(header) + "\n").encode("ascii", "replace"))
        for start in range(0, count, _ROWS):
            rows = np.empty(min(_ROWS, count - start), dtype)
            for name, values in columns.items():
                rows[name] = values[start : start + len(rows)]
            file.write(rows.tobytes())


def _plain(name: str, values: NDArray) -> NDArray:
    if values.ndim != 1 or not name.isascii() or not name.isidentifier():
        raise ValueError(f"{name!r} cannot be a PLY property")
    if values.dtype == bool:
        return values.astype(np.uint8)
    if values.dtype.kind == "i" and values.dtype.itemsize == 8:
        if len(values) and (values.min() < -(2**31) or values.max() >= 2**31):
            raise ValueError(f"{name!r} has values that do not fit into 32 bits")
        return values.astype(np.int32)
    if values.dtype.str[1:] not in _TYPES:
        raise ValueError(f"{name!r} has type {values.dtype}, which PLY does not have")
    return values
