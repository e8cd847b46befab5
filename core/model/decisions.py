"""A person's decisions over verdicts, in the IFC file: the property set ``BimVerify_Decision``.

The computed verdict stays in ``BimVerify_Verification``; what a person decided instead stands beside it with the reason,
so a later run, by a window or without one, finds it again and nothing is lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import BimVerifyError
from ..files import whole_file
from ..results import STATUSES, Decision
from .load import open_ifc
from .write_psets import LONGEST_LABEL, element_by_id, own_set, plain_values, require_owner
from .write_psets import PSET_NAME as VERIFICATION

PSET_NAME = "BimVerify_Decision"
NAMES = ("Status", "Reason", "DecidedBy", "DecidedOn", "ComputedStatus")


def read_decisions(file: Any) -> dict[str, Decision]:
    """GlobalId -> decision, of an open ``ifcopenshell.file``; sets that make no sense are passed over."""
    found: dict[str, Decision] = {}
    for pset in file.by_type("IfcPropertySet"):
        if pset.Name != PSET_NAME:
            continue
        value = {name: str(v) for name, v in plain_values(pset).items()}
        status = next((s for s in STATUSES if s == value.get("Status")), None)
        if status is None:
            continue
        for product in _owners(pset):
            found[product.GlobalId] = Decision(
                status, value.get("Reason", ""), value.get("DecidedBy", ""), value.get("DecidedOn", ""),
                value.get("ComputedStatus", ""),
            )  # fmt: skip
    return found


def decisions_in(path: str | Path) -> dict[str, Decision]:
    """The decisions in an IFC file; BimVerifyError when it cannot be read. Only files that hold some are parsed."""
    with Path(path).open("rb") as stream:
        if not _mentions(stream, PSET_NAME.encode()):
            return {}
    return read_decisions(open_ifc(path))


def apply_decisions(file: Any, decisions: Mapping[str, Decision]) -> int:
    """Write them to an open file, each replacing what was there; how many elements were found."""
    import ifcopenshell.api.pset

    found = 0
    for global_id, decision in decisions.items():
        product = element_by_id(file, global_id)
        if product is None:
            continue
        found += 1
        require_owner(file)
        pset = own_set(file, product, PSET_NAME)
        if pset is None:
            pset = ifcopenshell.api.pset.add_pset(file, product=product, name=PSET_NAME)
        ifcopenshell.api.pset.edit_pset(file, pset=pset, properties=_properties(file, decision), should_purge=True)
    return found


def remove_decision(file: Any, global_id: str) -> None:
    """Take a decision back: the computed verdict holds again."""
    import ifcopenshell.api.pset

    product = element_by_id(file, global_id)
    if product is None:
        return
    pset = own_set(file, product, PSET_NAME)
    if pset is not None:
        ifcopenshell.api.pset.remove_pset(file, product=product, pset=pset)


def _properties(file: Any, decision: Decision) -> dict[str, Any]:
    values = (decision.status, decision.reason, decision.author, decision.date, decision.computed)
    made = {}
    for name, text in zip(NAMES, values, strict=True):
        kind = "IfcText" if name == "Reason" else "IfcLabel"
        made[name] = file.create_entity(kind, text if kind == "IfcText" else text[:LONGEST_LABEL]) if text else None
    return made


def _owners(pset: Any) -> list[Any]:
    relations = pset.file.get_inverse(pset)
    return [o for r in relations if r.is_a("IfcRelDefinesByProperties") for o in r.RelatedObjects]


def _mentions(stream: Any, word: bytes, block: int = 1 << 22) -> bool:
    tail = b""
    while chunk := stream.read(block):
        if word in tail + chunk:
            return True
        tail = chunk[-len(word) :]
    return False




def write_decisions(source: str | Path, out: str | Path, decisions: Mapping[str, Decision | None]) -> None:
    """Copy a verified IFC with decisions on its elements; None takes one back. The source is only read.

    Raises BimVerifyError when an element is not in the file or was not verified, or when ``out`` cannot be written.
    """
    import ifcopenshell.util.element

    with whole_file(out) as temporary:
        file = open_ifc(source)
        made: dict[str, Decision] = {}
        for global_id, decision in decisions.items():
            product = element_by_id(file, global_id)
            if product is None:
                raise BimVerifyError(f"{source} has no element {global_id}. Give its GlobalId.")
            computed = ifcopenshell.util.element.get_pset(product, VERIFICATION, "Status")
            if computed is None:
                raise BimVerifyError(f"{global_id} carries no verdict in {source}. Give the file that verify wrote.")
            if decision is None:
                remove_decision(file, global_id)
            else:
                made[global_id] = replace(decision, computed=str(computed))
        apply_decisions(file, made)
        file.write(str(temporary))
