"""The report of an update: what was moved or put back, by how much, and what followed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..report.plain_page import Section, millimetres, write_page
from .update import FOLLOWS, KEPT, OWN, UpdateResult, update_lines

TITLES = {
    OWN: ("Moved", "By the displacement that its verification found."),
    FOLLOWS: ("Followed", "Openings, fillings and parts of what was moved."),
    KEPT: ("Kept", "Hang on something that was moved, and kept their place in the world."),
}


def write_update_report(folder: str | Path, result: UpdateResult, model: str, undo: bool) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    sections = []
    for kind, (title, text) in TITLES.items():
        own = [u for u in result.updates if u.kind == kind]
        rows = [
            (u.name or u.global_id, u.ifc_class, u.global_id, *(millimetres(v) for v in u.shift),
             millimetres(float(np.linalg.norm(u.shift))))
            for u in sorted(own, key=lambda u: -float(np.linalg.norm(u.shift)))
        ]  # fmt: skip
        if rows:
            sections.append(Section(
                f"{title}, put back" if undo else title, text, rows=rows, numeric=frozenset({3, 4, 5, 6}),
                columns=("Element", "Class", "GlobalId", "X mm", "Y mm", "Z mm", "Distance mm"),
            ))  # fmt: skip
    if result.notes:
        sections.append(Section("Notes", columns=("Note",), rows=[(note,) for note in result.notes]))
    headline = update_lines(result, undo)[0]
    return write_page(folder, "Update", "The model moved to what was built", headline, [("Model", Path(model).name)], sections)
