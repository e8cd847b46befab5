"""What an IFC file holds, for ``info``."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from ..errors import BimVerifyError
from .load import open_ifc, physical_products


def is_ifc(path: str | Path) -> bool:
    """Whether a file begins like an IFC file in STEP form. Raises BimVerifyError when it cannot be read."""
    try:
        with Path(path).open("rb") as stream:
            return b"ISO-10303-21" in stream.read(4096)
    except OSError as error:
        raise BimVerifyError(f"Cannot read {path}: {error.strerror}. Check the path.") from error


def describe_model(path: str | Path) -> dict[str, Any]:
    """Schema, unit, storeys, map conversion and the physical elements by class, without tessellating."""
    import ifcopenshell.util.unit

    file = open_ifc(path)
    conversions = [] if file.schema.startswith("IFC2X3") else file.by_type("IfcMapConversion")
    return {
        "path": str(path),
        "format": "IFC",
        "schema": file.schema,
        "project": next((p.Name or "" for p in file.by_type("IfcProject")), ""),
        "length_unit_m": float(ifcopenshell.util.unit.calculate_unit_scale(file)),
        "storeys": [s.Name or "" for s in file.by_type("IfcBuildingStorey")],
        "map_conversion": bool(conversions),
        "elements": dict(sorted(Counter(p.is_a() for p in physical_products(file)).items())),
    }


def format_model(description: dict[str, Any]) -> str:
    """Lines for people."""
    elements = description["elements"]
    counts = ", ".join(f"{count} {name}" for name, count in elements.items()) or "none"
    placed = "with" if description["map_conversion"] else "without"
    return (
        f"{description['path']}: {description['schema']}, project {description['project']!r}, "
        f"1 length unit = {description['length_unit_m']:g} m, {placed} map conversion\n"
        f"  storeys: {', '.join(description['storeys']) or 'none'}\n"
        f"  {sum(elements.values())} physical elements with a shape: {counts}"
    )
