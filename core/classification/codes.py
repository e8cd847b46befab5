"""LAS classification codes of IFC classes: those of ASPRS where one fits, user codes from 64 on for the rest."""

from __future__ import annotations

UNCLASSIFIED = 1
OTHER = 80
CODES: tuple[tuple[int, tuple[str, ...]], ...] = (
    (2, ("IfcSite", "IfcGeographicElement", "IfcEarthworks")),
    (11, ("IfcPavement", "IfcCourse", "IfcRoad")),
    (10, ("IfcRail", "IfcTrackElement")),
    (17, ("IfcBridge",)),
    (64, ("IfcWall",)),
    (65, ("IfcSlab",)),
    (66, ("IfcRoof",)),
    (67, ("IfcColumn",)),
    (68, ("IfcBeam", "IfcMember")),
    (69, ("IfcDoor",)),
    (70, ("IfcWindow",)),
    (71, ("IfcCurtainWall", "IfcPlate")),
    (72, ("IfcStair",)),
    (73, ("IfcRamp",)),
    (74, ("IfcRailing",)),
    (75, ("IfcCovering",)),
    (76, ("IfcFooting", "IfcPile")),
    (77, ("IfcFurn", "IfcSystemFurniture")),
    (78, ("IfcDistribution", "IfcFlow", "IfcEnergy", "IfcDuct", "IfcPipe", "IfcCable", "IfcValve", "IfcPump", "IfcFan",
          "IfcLamp", "IfcLight", "IfcSanitary", "IfcBoiler", "IfcTank", "IfcOutlet", "IfcAir", "IfcSpaceHeater",
          "IfcElectric", "IfcSensor", "IfcActuator", "IfcController", "IfcSwitching", "IfcJunctionBox", "IfcWasteTerminal")),
    (79, ("IfcBuildingElementProxy",)),
)  # fmt: skip
"""Code, and the beginnings of the class names that it stands for; the longest beginning that fits decides."""


def las_code(ifc_class: str) -> int:
    """The code of an IFC class, OTHER where the table does not know it."""
    fitting = [
        (len(name), code) for code, names in CODES for name in names if ifc_class.lower().startswith(name.lower())
    ]
    return max(fitting)[1] if fitting else OTHER
