"""Whether the property set templates know what was written."""

from __future__ import annotations

from typing import Any

from bim_verify.core.model.pset_definitions import TEMPLATES


def check_templates(file: Any, name: str) -> None:
    """Every property of every set of that name is in the template, with the same type; and there is one."""
    kinds = {key: kind for key, (kind, _) in TEMPLATES[name][1].items()}
    found = {(p.Name, p.NominalValue.is_a()) for s in file.by_type("IfcPropertySet") if s.Name == name for p in s.HasProperties}
    assert found
    assert {(key, kind) for key, kind in found if kinds.get(key) != kind} == set()
