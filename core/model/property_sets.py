"""A property set of any name on elements of an IFC file, from one record an element."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..progress import Progress
from .write_psets import TypedValue, apply_property_set, write_ifc_copy


@dataclass(frozen=True)
class ElementProperties:
    """The property set of one element: name -> (IFC type, value), None where nothing is known.

    Lengths are in metres and angles in radians until they are written.
    """

    global_id: str
    step_id: int
    values: dict[str, TypedValue]


def write_property_sets(
    source_ifc: str | Path, pset_name: str, entries: Sequence[ElementProperties], out: str | Path, *,
    progress: Progress | None = None,
) -> None:
    """Copy ``source_ifc`` to ``out`` with the entries as property sets ``pset_name``; the source is only read.

    Raises BimVerifyError as ``write_psets.write_ifc_copy`` does; nothing is left behind then.
    """
    write_ifc_copy(
        source_ifc, out, lambda file: put_property_sets(file, pset_name, entries, progress=progress) or not entries
    )


def put_property_sets(
    ifc_file: Any, pset_name: str, entries: Sequence[ElementProperties], *, progress: Progress | None = None
) -> int:
    """Put the entries on the elements of an open ``ifcopenshell.file`` and return how many elements were found."""
    rows = ((entry.step_id, entry.global_id, entry.values) for entry in entries)
    return apply_property_set(ifc_file, pset_name, rows, len(entries), progress)
