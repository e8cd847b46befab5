"""Elements of an IFC file moved in its world by their local placements, and by nothing else."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Changed:
    """The local placement of a product before it was changed. File units."""

    product: Any
    before: tuple[float, float, float]
    """Location relative to the placement that it hangs on."""


def move(file: Any, shifts: Mapping[int, Vector]) -> list[Changed]:
    """Move products (STEP id -> shift (3,), file units, world axes); everything else keeps its place in the world.

    A placement that products with other shifts use too is split; what hangs on a moved placement and is not moved itself
    gets a local placement that leaves it where it was. Products that hang on nothing local (a grid, an alignment) are left
    as they are. Returns what was changed, by product.
    """
    nodes = _nodes(file)
    users: dict[int, list[Any]] = defaultdict(list)
    for product in file.by_type("IfcProduct"):
        placement = product.ObjectPlacement
        if placement is None and product.id() in shifts and product.Representation is not None:
            placement = product.ObjectPlacement = file.create_entity("IfcLocalPlacement", None, _axes(file, np.zeros(3)))
            nodes[placement.id()] = placement
        if placement is not None and placement.is_a("IfcLocalPlacement"):
            users[placement.id()].append(product)
    shift_of: dict[int, Vector] = {}
    changed: list[Changed] = []
    for key, node in _parents_first(nodes):
        groups: dict[tuple[float, ...], list[Any]] = defaultdict(list)
        for product in users[key]:
            groups[tuple(float(v) for v in shifts.get(product.id(), np.zeros(3)))].append(product)
        parent = node.PlacementRelTo
        carried = shift_of.get(parent.id(), np.zeros(3)) if parent is not None else np.zeros(3)
        if not groups:
            shift_of[key] = carried
            continue
        stays = max(groups, key=lambda s: (not any(s), len(groups[s])))
        shift_of[key] = np.array(stays)
        for shift in sorted(groups, key=lambda s: s == stays):
            if shift != stays:
                own = file.create_entity("IfcLocalPlacement", parent, node.RelativePlacement)
                for product in groups[shift]:
                    product.ObjectPlacement = own
            else:
                own = node
            changed += _shift(file, own, groups[shift], np.array(shift) - carried)
    return changed


def with_what_hangs_on_it(file: Any, shifts: Mapping[int, Vector]) -> dict[int, Vector]:
    """The same shifts, and those of all products whose placements hang on a moved product's and that have none of their own."""
    out = dict(shifts)
    shift_of = {
        p.ObjectPlacement.id(): shift for row, shift in shifts.items() if (p := file.by_id(row)).ObjectPlacement is not None
    }
    for product in file.by_type("IfcProduct"):
        node, seen = product.ObjectPlacement, set()
        while node is not None and product.id() not in out and node.id() not in seen and node.is_a("IfcLocalPlacement"):
            seen.add(node.id())
            if node.id() in shift_of:
                out[product.id()] = shift_of[node.id()]
            node = node.PlacementRelTo
    return out


def location_of(placement: Any) -> tuple[float, float, float]:
    """Of a local placement, relative to what it hangs on, file units."""
    relative = placement.RelativePlacement
    point = list(relative.Location.Coordinates) if relative is not None else []
    x, y, z = (float(v) for v in [*point, 0.0, 0.0, 0.0][:3])
    return x, y, z


def _shift(file: Any, placement: Any, products: list[Any], by: Vector) -> list[Changed]:
    if not by.any():
        return []
    before = location_of(placement)
    _relocate(file, placement, np.array(before) + _turn(placement.PlacementRelTo).T @ by)
    return [Changed(product, before) for product in products]


def _relocate(file: Any, placement: Any, location: Vector) -> None:
    """A new location; the old axes stay with whoever shares them."""
    old = placement.RelativePlacement
    placement.RelativePlacement = _axes(file, location, old)
    if old is not None and not file.get_total_inverses(old):
        point = old.Location
        file.remove(old)
        if not file.get_total_inverses(point):
            file.remove(point)


def _axes(file: Any, location: Vector, like: Any = None) -> Any:
    point = file.create_entity("IfcCartesianPoint", [float(v) for v in location])
    if like is None:
        return file.create_entity("IfcAxis2Placement3D", point)
    if like.is_a("IfcAxis2Placement2D"):
        x = like.RefDirection
        flat = None if x is None else file.create_entity("IfcDirection", [*x.DirectionRatios, 0.0])
        up = None if x is None else file.create_entity("IfcDirection", [0.0, 0.0, 1.0])
        return file.create_entity("IfcAxis2Placement3D", point, up, flat)
    return file.create_entity("IfcAxis2Placement3D", point, like.Axis, like.RefDirection)


def _nodes(file: Any) -> dict[int, Any]:
    return {node.id(): node for node in file.by_type("IfcLocalPlacement")}


def _parents_first(nodes: dict[int, Any]) -> list[tuple[int, Any]]:
    depth: dict[int, int] = {}
    for key, node in nodes.items():
        chain = []
        while node is not None and node.id() in nodes and node.id() not in depth:
            if node.id() in chain:  # relative to itself: such a file is refused when its model is loaded
                depth[node.id()] = 0
                break
            chain.append(node.id())
            node = node.PlacementRelTo
        base = depth.get(node.id(), -1) if node is not None else -1
        for rank, link in enumerate(reversed(chain), 1):
            depth.setdefault(link, base + rank)
        depth.setdefault(key, 0)
    return sorted(nodes.items(), key=lambda item: (depth[item[0]], item[0]))


def _turn(placement: Any) -> NDArray[np.float64]:
    """(3, 3) from the axes of a placement to those of the world."""
    import ifcopenshell.util.placement

    if placement is None:
        return np.eye(3)
    return np.array(ifcopenshell.util.placement.get_local_placement(placement)[:3, :3], dtype=np.float64)
