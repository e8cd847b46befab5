"""Elements that were verified and found displaced go to their as-built place; what was before is kept for the way back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..model.decisions import read_decisions
from ..model.property_sets import ElementProperties, put_property_sets
from ..model.write_psets import PSET_NAME as VERIFICATION
from ..model.write_psets import own_set, plain_values
from .placements import Changed, location_of, move, with_what_hangs_on_it

PSET_NAME = "BimVerify_Update"
OWN, FOLLOWS, KEPT = "MOVED", "FOLLOWS", "KEPT"
"""Moved by its own displacement; with its host, whole or filling; its place kept though what it hangs on moved."""
MOST_SHIFT_M = 10.0
"""An element is not found farther from its plan: a larger number is none of a verification."""
TOLD = 5
"""Notes that are told one by one; the report and the JSON file have all."""
SAME_SHIFT = 1e-9
"""Relative: a displacement that was applied already."""

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Update:
    """What happened to one product. Metres, model frame."""

    global_id: str
    ifc_class: str
    name: str
    kind: str
    shift: tuple[float, float, float]
    """In this update."""


@dataclass(frozen=True)
class UpdateResult:
    """All that was moved, or put back; and sentences on what could not be."""

    updates: tuple[Update, ...]
    notes: tuple[str, ...] = ()

    def count(self, kind: str) -> int:
        """Products of one kind."""
        return sum(u.kind == kind for u in self.updates)


@dataclass(frozen=True)
class UpdatedFile:
    """What ``--blend`` shows: what was moved, and the open file after it."""

    result: UpdateResult
    file: Any


def update_file(file: Any) -> UpdateResult:
    """Move the elements of an open ``ifcopenshell.file`` that are DEVIATING with a significant displacement.

    A person's decision goes before the verdict. Openings, fillings and parts follow what they belong to, unless they were
    found displaced themselves; an opening goes with its only filling where that was. Each product that moved, or whose
    local placement changed, gets ``BimVerify_Update``. A displacement that was applied before is not applied again.
    """
    import ifcopenshell.util.unit

    unit = float(ifcopenshell.util.unit.calculate_unit_scale(file))
    records = {p.id(): found for p, found in _with_set(file, PSET_NAME)}
    own, notes, verified = _displaced(file, records, unit)
    if not verified:
        raise BimVerifyError(
            f"The model carries no property set {VERIFICATION}: write it first (bim-verify verify ... --out VERIFIED.ifc)."
        )
    shifts, follows = dict(own), dict[int, str]()
    for row, source in list(own.items()):
        _carry(file.by_id(row), source, own, shifts, follows)
    notes += _carry_wholes(file, own, shifts, follows)
    for row, shift in own.items():
        for opening in _openings_of_filling(file.by_id(row)):
            shifts[opening.id()], follows[opening.id()] = shift, file.by_id(row).GlobalId
    notes += _confirmed_followers(file, follows)
    changed = move(file, shifts)
    done = {c.product.id() for c in changed}
    rest = [file.by_id(row) for row in shifts if row not in done]
    carried = [Changed(p, location_of(p.ObjectPlacement)) for p in rest if p.ObjectPlacement is not None]
    entries = [_entry(c, shifts, own, follows, records, unit) for c in (*changed, *carried)]
    put_property_sets(file, PSET_NAME, entries)
    updates = [_update(file.by_id(row), OWN if row in own else FOLLOWS, shift * unit) for row, shift in shifts.items()]
    updates += [_update(c.product, KEPT, np.zeros(3)) for c in changed if c.product.id() not in shifts]
    return UpdateResult(tuple(updates), tuple(notes))


def undo_file(file: Any) -> UpdateResult:
    """Take back, in the world, how far everything that carries ``BimVerify_Update`` was moved, and remove that set.

    What hangs on it goes along, as it does for an edit, unless it carries the set itself. Placements may hang on others
    than at the time of the update. Verdicts that were found after the update are of the other place, and are removed.
    """
    import ifcopenshell.api.pset
    import ifcopenshell.util.unit

    unit = float(ifcopenshell.util.unit.calculate_unit_scale(file))
    shifts: dict[int, Vector] = {}
    updates, notes = [], []
    records = list(_with_set(file, PSET_NAME))
    anew = any(_verified_anew(product, values) for product, values in records)
    dropped = 0
    for product, values in records:
        moved = _vector(values, "Moved")
        if moved is None:
            continue
        if product.ObjectPlacement is not None and not product.ObjectPlacement.is_a("IfcLocalPlacement"):
            notes.append(f"{_called(product)} is placed by {product.ObjectPlacement.is_a()} and was not put back.")
            continue
        shifts[product.id()] = -moved
        pset = own_set(file, product, PSET_NAME)
        if pset is not None:
            ifcopenshell.api.pset.remove_pset(file, product=product, pset=pset)
        verdict = own_set(file, product, VERIFICATION) if anew and moved.any() else None
        if verdict is not None:
            ifcopenshell.api.pset.remove_pset(file, product=product, pset=verdict)
            dropped += 1
        updates.append(_update(product, str(values.get("Kind", OWN)), -moved * unit))
    if dropped:
        notes.append(
            f"{dropped} verdicts were found after the update, at the other place, and were removed; verify the model again."
        )
    if not updates:
        raise BimVerifyError(f"The model carries no property set {PSET_NAME}, so there is nothing to undo.")
    move(file, with_what_hangs_on_it(file, shifts))
    return UpdateResult(tuple(updates), tuple(notes))


def _verified_anew(product: Any, record: dict[str, Any]) -> bool:
    """Whether the verification of a product that was moved is another one than that which it was moved by."""
    applied, found = _vector(record, "Applied"), _verification_of(product)
    if applied is None or not found:
        return False
    shift = _vector(found, "Displacement", missing=0.0)
    return shift is None or not np.allclose(applied, shift, rtol=SAME_SHIFT, atol=0.0)


def _confirmed_followers(file: Any, follows: dict[int, str]) -> list[str]:
    """A note on what was found at its planned place and goes along all the same."""
    own = [file.by_id(row) for row in follows]
    names = [p.Name or p.GlobalId for p in own if _verification_of(p).get("Status") == "CONFIRMED"]
    if not names:
        return []
    told = ", ".join(names[:3]) + (" and others" if len(names) > 3 else "")
    return [f"CONFIRMED at their place, and moved along with what they belong to: {told}. Verify the model again."]


def update_lines(result: UpdateResult, undo: bool = False) -> list[str]:
    """The result in a few lines for a person."""
    if undo:
        return [f"{len(result.updates)} elements put back.", *_told(result.notes)]
    first = (
        f"{result.count(OWN)} displaced elements moved to where they stand, {result.count(FOLLOWS)} openings, fillings and "
        f"parts followed, {result.count(KEPT)} kept their place."
    )
    return [first, *_told(result.notes)]


def _told(notes: tuple[str, ...]) -> list[str]:
    more = [f"Note: {len(notes) - TOLD} more notes are in --report and --json."] if len(notes) > TOLD else []
    return [f"Note: {note}" for note in notes[:TOLD]] + more


def _displaced(
    file: Any, records: dict[int, dict[str, Any]], unit: float
) -> tuple[dict[int, Vector], list[str], bool]:
    """STEP id -> displacement (file units) of what is to be moved; notes; whether anything was verified."""
    decided = read_decisions(file)
    found: dict[int, Vector] = {}
    notes: list[str] = []
    verified = False
    for product, values in _with_set(file, VERIFICATION):
        verified = True
        decision = decided.get(product.GlobalId)
        status = values.get("Status") if decision is None else decision.status
        shift = _vector(values, "Displacement", missing=0.0)
        if status != "DEVIATING" or values.get("Significant") is not True or shift is None or not shift.any():
            continue
        applied = _vector(records.get(product.id(), {}), "Applied")
        if applied is not None and np.allclose(applied, shift, rtol=SAME_SHIFT, atol=0.0):
            notes.append(f"{_called(product)} was moved by this displacement before; verify the model again.")
            continue
        distance = float(np.linalg.norm(shift)) * unit
        if distance > MOST_SHIFT_M:
            notes.append(f"{_called(product)} is said to stand {distance:.4g} m from its plan, and was not moved.")
            continue
        placement = product.ObjectPlacement
        if placement is not None and not placement.is_a("IfcLocalPlacement"):
            notes.append(f"{_called(product)} is placed by {placement.is_a()} and was not moved.")
            continue
        found[product.id()] = shift
    return found, notes, verified


def _carry(
    host: Any, shift: Vector, own: dict[int, Vector], shifts: dict[int, Vector], follows: dict[int, str]
) -> None:
    """Openings, what fills them, and parts get the shift of ``host``, unless they have one of their own."""
    for dependent in _dependents(host):
        if dependent.id() in own or dependent.id() in follows:
            continue
        shifts[dependent.id()], follows[dependent.id()] = shift, host.GlobalId
        _carry(dependent, shift, own, shifts, follows)


def _carry_wholes(
    file: Any, own: dict[int, Vector], shifts: dict[int, Vector], follows: dict[int, str]
) -> list[str]:
    """A whole goes with its parts where all of them moved alike, and takes its openings along; notes on the others."""
    notes = []
    wholes = {w.id() for row in own for w in _wholes(file.by_id(row))} - own.keys() - follows.keys()
    for row in sorted(wholes):
        whole = file.by_id(row)
        parts = [p for r in whole.IsDecomposedBy for p in r.RelatedObjects if p.is_a("IfcProduct")]
        shift = next(own[p.id()] for p in parts if p.id() in own)
        if all(p.id() in own and np.allclose(own[p.id()], shift, rtol=0.0, atol=1e-9) for p in parts):
            shifts[row], follows[row] = shift, parts[0].GlobalId
            _carry(whole, shift, own, shifts, follows)
        elif getattr(whole, "HasOpenings", None):
            notes.append(f"Parts of {_called(whole)} moved differently; its openings and what fills them kept their place.")
    return notes


def _wholes(product: Any) -> Iterable[Any]:
    for relation in getattr(product, "Decomposes", None) or ():
        if relation.RelatingObject.is_a("IfcElement"):
            yield relation.RelatingObject


def _dependents(product: Any) -> Iterable[Any]:
    for relation in getattr(product, "HasOpenings", None) or ():
        yield relation.RelatedOpeningElement
    for relation in getattr(product, "HasFillings", None) or ():
        yield relation.RelatedBuildingElement
    for relation in getattr(product, "HasProjections", None) or ():
        yield relation.RelatedFeatureElement
    for relation in getattr(product, "HasCoverings", None) or ():
        yield from (c for c in relation.RelatedCoverings if _verification_of(c).get("Status") != "CONFIRMED")
    for relation in (*(getattr(product, "IsDecomposedBy", None) or ()), *(getattr(product, "IsNestedBy", None) or ())):
        yield from (part for part in relation.RelatedObjects if part.is_a("IfcProduct"))


def _openings_of_filling(product: Any) -> Iterable[Any]:
    for relation in getattr(product, "FillsVoids", None) or ():
        opening = relation.RelatingOpeningElement
        if opening is not None and len(opening.HasFillings or ()) == 1:
            yield opening


def _entry(
    change: Changed, shifts: dict[int, Vector], own: dict[int, Vector], follows: dict[int, str],
    records: dict[int, dict[str, Any]], unit: float,
) -> ElementProperties:
    product = change.product
    row = product.id()
    earlier = records.get(row, {})
    before = _vector(earlier, "Previous")
    before = np.array(change.before) if before is None else before
    moved = shifts.get(row, np.zeros(3)) + (0.0 if (past := _vector(earlier, "Moved")) is None else past)
    kind = OWN if row in own else FOLLOWS if row in follows else KEPT
    source = _verification_of(product)
    length = "IfcLengthMeasure"
    values: dict[str, tuple[str, Any]] = {"Kind": ("IfcLabel", kind), "Follows": ("IfcLabel", follows.get(row))}
    applied = own.get(row)
    for k, axis in enumerate("XYZ"):
        values[f"Previous{axis}"] = (length, float(before[k]) * unit)
        values[f"Moved{axis}"] = (length, float(moved[k]) * unit)
        values[f"Applied{axis}"] = (length, None if applied is None else float(applied[k]) * unit)
    for name in ("ScanSource", "ScanDate", "Method"):
        values[name] = ("IfcLabel", source.get(name))
    return ElementProperties(product.GlobalId, row, values)


def _called(product: Any) -> str:
    """Its name, if it has one, and its GlobalId."""
    return f"{product.Name} ({product.GlobalId})" if product.Name else str(product.GlobalId)


def _verification_of(product: Any) -> dict[str, Any]:
    import ifcopenshell.util.element

    return dict(ifcopenshell.util.element.get_psets(product).get(VERIFICATION, {}))


def _with_set(file: Any, name: str) -> Iterable[tuple[Any, dict[str, Any]]]:
    """Products with a property set of that name, and its plain values."""
    seen: set[int] = set()
    for relation in file.by_type("IfcRelDefinesByProperties"):
        pset = relation.RelatingPropertyDefinition
        if not pset.is_entity() or not pset.is_a("IfcPropertySet") or pset.Name != name:
            continue
        values = plain_values(pset)
        for product in relation.RelatedObjects:
            if product.is_a("IfcProduct") and product.id() not in seen:
                seen.add(product.id())
                yield product, values


def _vector(values: dict[str, Any], name: str, missing: float | None = None) -> Vector | None:
    """``nameX``, ``nameY``, ``nameZ`` as (3,); None where one is no number, or (without ``missing``) not there."""
    parts = [values.get(f"{name}{axis}", missing) for axis in "XYZ"]
    if any(not isinstance(part, float | int) or not np.isfinite(part) for part in parts):
        return None
    return np.array(parts, dtype=np.float64)


def _update(product: Any, kind: str, shift: Vector) -> Update:
    x, y, z = (float(v) for v in shift)
    return Update(product.GlobalId, product.is_a(), product.Name or "", kind, (x, y, z))
