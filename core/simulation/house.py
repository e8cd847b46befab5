"""The built-in demo house: two storeys, terrace and balcony, pitched roof, stair, ducts, furniture. Millimetres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .furniture import bed, chair, counter, shelf, sofa, table
from .house_builder import Axis, HouseBuilder, Point, Solid, at, box, prism, tube

LENGTH, WIDTH = 10000.0, 7500.0
OUTER, INNER = 300.0, 150.0
CLEAR = 2700.0
"""Height of the ground floor's rooms."""
UPPER = 2950.0
"""Level of the upper floor."""
EAVES = 5250.0
"""Where the roof's underside meets the outer face of the long walls."""
PITCH = math.tan(math.radians(35.0))
RIDGE = EAVES + WIDTH / 2 * PITCH
ROOF_HEIGHT = 220.0 / math.cos(math.radians(35.0))
FRAME, PANE = 70.0, 28.0


def write_demo_house(path: str | Path, *, schema: str = "IFC4") -> None:
    """Write the demo house as an IFC file (IFC2X3, IFC4 or IFC4X3). The same schema gives the same file, byte for byte.

    Raises BimVerifyError for another schema, or when ``path`` cannot be written.
    """
    house = HouseBuilder(schema)
    ground = house.storey("Ground floor", 0.0)
    upper = house.storey("Upper floor", UPPER)
    _garden(house, ground)
    _structure(house, ground, upper)
    walls = _walls(house, ground, upper)
    _openings(house, walls, ground, upper)
    _terrace(house, ground, upper)
    _roof(house, upper)
    _stair(house, ground, upper)
    _ceilings_and_ducts(house, ground)
    _furniture(house, ground, upper)
    house.write(path)


def _roof_underside(y: float) -> float:
    """Height of the roof's underside over a line along the house."""
    return EAVES + min(y, WIDTH - y) * PITCH


def _garden(house: HouseBuilder, ground: Any) -> None:
    lawn = Solid(
        ((-4800, -7400), (14200, -7400), (14200, 12400), (-4800, 12400)), "z", -360, 300, "grass",
        holes=(((0, 0), (LENGTH, 0), (LENGTH, WIDTH), (0, WIDTH)),),
    )
    house.add("IfcGeographicElement", "Lawn", [lawn], ground, predefined="TERRAIN")
    house.add(
        "IfcSlab", "Terrace paving", [box(800, -3300, -60, 8400, 3300, 50, "paving")], ground, predefined="FLOOR",
        material="Paving stone",
        common={"Reference": "Paving 50", "IsExternal": True, "LoadBearing": False},
    )
    house.add(
        "IfcSlab", "Entrance step", [box(6900, WIDTH, -60, 1800, 1400, 50, "paving")], ground, predefined="LANDING",
        material="Concrete", common={"Reference": "Step", "IsExternal": True, "LoadBearing": False},
    )
    house.add(
        "IfcBuildingElementProxy", "Heat pump",
        [
            box(LENGTH + 500, 5200, -60, 450, 1100, 80, "concrete"),
            box(LENGTH + 520, 5230, 20, 410, 1040, 950, "white"),
            tube(5750, 500, "x", LENGTH + 930, 25, 360, "anthracite"),
        ],
        ground,
    )


def _structure(house: HouseBuilder, ground: Any, upper: Any) -> None:
    strips = {
        "south": box(0, 0, -1000, LENGTH, 500, 750, "concrete"),
        "north": box(0, WIDTH - 500, -1000, LENGTH, 500, 750, "concrete"),
        "west": box(0, 500, -1000, 500, WIDTH - 1000, 750, "concrete"),
        "east": box(LENGTH - 500, 500, -1000, 500, WIDTH - 1000, 750, "concrete"),
    }
    for side, strip in strips.items():
        house.add(
            "IfcFooting", f"Strip footing {side}", [strip], ground, predefined="STRIP_FOOTING", material="Concrete",
            common={"Reference": "Strip 500x750", "LoadBearing": True},
        )
    house.add(
        "IfcSlab", "Base slab", [box(0, 0, -250, LENGTH, WIDTH, 250, "concrete")], ground, predefined="BASESLAB",
        type_class="IfcSlabType", type_name="Concrete slab 250", material="Concrete",
        common={"Reference": "Slab 250", "IsExternal": False, "LoadBearing": True},
    )
    floor = house.add(
        "IfcSlab", "Upper floor slab", [box(0, 0, CLEAR, LENGTH, WIDTH, 250, "concrete")], upper, predefined="FLOOR",
        type_class="IfcSlabType", type_name="Concrete slab 250", material="Concrete",
        common={"Reference": "Slab 250", "IsExternal": False, "LoadBearing": True},
    )
    house.opening(floor, box(1500, 6150, CLEAR - 10, 3550, 1050, 270, "concrete"))
    beams = {
        "Living room beam": (box(OUTER, 3700, CLEAR - 250, 6100, 200, 250, "timber"), ground),
        "Ridge beam": (
            prism(
                [(3670, RIDGE - 340), (3830, RIDGE - 340), (3830, RIDGE - 80 * PITCH),
                 (3750, RIDGE), (3670, RIDGE - 80 * PITCH)],
                "x", OUTER, LENGTH - 2 * OUTER, "timber",
            ),
            upper,
        ),
    }
    for name, (solid, storey) in beams.items():
        house.add(
            "IfcBeam", name, [solid], storey, predefined="BEAM", type_class="IfcBeamType", type_name="Glulam",
            material="Timber", common={"Reference": "GL24h", "IsExternal": False, "LoadBearing": True},
        )


@dataclass(frozen=True)
class _Wall:
    """A wall, its own direction, and where its thickness lies across it."""

    product: Any
    along: Axis
    across: float
    thickness: float


def _walls(house: HouseBuilder, ground: Any, upper: Any) -> dict[str, _Wall]:
    inside_w, top_in = WIDTH - OUTER, _roof_underside(OUTER)
    gable: list[Point] = [
        (OUTER, UPPER), (inside_w, UPPER), (inside_w, top_in), (WIDTH / 2, RIDGE), (OUTER, top_in)
    ]
    long_wall: list[Point] = [(0, UPPER), (OUTER, UPPER), (OUTER, top_in), (0, EAVES)]
    mirrored = [(WIDTH - y, z) for y, z in long_wall]
    corridor = _roof_underside(4450.0)
    between: list[Point] = [
        (OUTER, UPPER), (4300, UPPER), (4300, _roof_underside(4300)), (3830, _roof_underside(3830)),
        (3830, RIDGE - 340), (3670, RIDGE - 340), (3670, _roof_underside(3670)), (OUTER, top_in),
    ]
    bath: list[Point] = [
        (4450, UPPER), (inside_w, UPPER), (inside_w, _roof_underside(inside_w)), (4450, _roof_underside(4450))
    ]
    plan: list[tuple[str, Solid, Any, Axis, float, float]] = [
        ("South wall", box(0, 0, 0, LENGTH, OUTER, CLEAR, "render"), ground, "x", 0, OUTER),
        ("North wall", box(0, inside_w, 0, LENGTH, OUTER, CLEAR, "render"), ground, "x", inside_w, OUTER),
        ("West wall", box(0, OUTER, 0, OUTER, WIDTH - 2 * OUTER, CLEAR, "render"), ground, "y", 0, OUTER),
        ("East wall", box(LENGTH - OUTER, OUTER, 0, OUTER, WIDTH - 2 * OUTER, CLEAR, "render"), ground, "y",
         LENGTH - OUTER, OUTER),
        ("Living room wall", box(6400, OUTER, 0, INNER, WIDTH - 2 * OUTER, CLEAR, "plaster"), ground, "y", 6400, INNER),
        ("Kitchen wall", box(6550, 4000, 0, 3150, INNER, CLEAR, "plaster"), ground, "x", 4000, INNER),
        ("Utility wall", box(8600, 4150, 0, 100, 3050, CLEAR, "plaster"), ground, "y", 8600, 100),
        ("Upper south wall", prism(long_wall, "x", 0, LENGTH, "render"), upper, "x", 0, OUTER),
        ("Upper north wall", prism(mirrored, "x", 0, LENGTH, "render"), upper, "x", inside_w, OUTER),
        ("West gable", prism(gable, "x", 0, OUTER, "render"), upper, "y", 0, OUTER),
        ("East gable", prism(gable, "x", LENGTH - OUTER, OUTER, "render"), upper, "y", LENGTH - OUTER, OUTER),
        ("Corridor wall", box(OUTER, 4300, UPPER, LENGTH - 2 * OUTER, INNER, corridor - UPPER, "plaster"), upper, "x",
         4300, INNER),
        ("Bedroom wall", prism(between, "x", 5000, INNER, "plaster"), upper, "y", 5000, INNER),
        ("Bathroom wall", prism(bath, "x", 6800, 100, "plaster"), upper, "y", 6800, 100),
    ]
    walls = {}
    for name, solid, storey, along, across, thickness in plan:
        outside = thickness == OUTER
        product = house.add(
            "IfcWall", name, [solid], storey, predefined="SOLIDWALL", type_class="IfcWallType",
            type_name=f"{'Exterior' if outside else 'Interior'} wall {thickness:.0f}",
            material="Brick, rendered" if outside else "Lightweight block",
            common={"Reference": f"W{thickness:.0f}", "IsExternal": outside, "LoadBearing": outside},
        )
        walls[name] = _Wall(product, along, across, thickness)
    return walls


def _openings(house: HouseBuilder, walls: dict[str, _Wall], ground: Any, upper: Any) -> None:
    windows: list[tuple[str, str, float, float, float, float]] = [
        ("Terrace glazing west", "South wall", 1900, 20, 2400, 2280),
        ("Terrace glazing east", "South wall", 6900, 20, 2200, 2280),
        ("Living room window west", "West wall", 2000, 800, 1800, 1400),
        ("Living room window north", "North wall", 5300, 900, 900, 1200),
        ("Kitchen window", "East wall", 1400, 1000, 1600, 1100),
        ("Utility window", "East wall", 5300, 1400, 700, 700),
        ("Bedroom window west", "Upper south wall", 1300, UPPER + 800, 1300, 1200),
        ("Bedroom window east", "Upper south wall", 7100, UPPER + 800, 1300, 1200),
        ("Gable window west", "West gable", 1700, UPPER + 800, 1200, 1300),
        ("Gable window east", "East gable", 1700, UPPER + 800, 1200, 1300),
        ("Stair window", "Upper north wall", 2200, UPPER + 900, 1400, 1000),
        ("Corridor window", "Upper north wall", 5500, UPPER + 900, 900, 1000),
        ("Bathroom window", "Upper north wall", 8000, UPPER + 900, 900, 1000),
    ]
    for name, host, along, sill, width, height in windows:
        storey = upper if sill > CLEAR else ground
        wall = walls[host]
        shape = _window(width, height)
        product = house.add(
            "IfcWindow", name, shape, storey, place=_in_wall(wall, along, sill), predefined="WINDOW",
            type_class="IfcWindowType", type_name=f"Window {width:.0f}x{height:.0f}", material="Timber",
            common={"Reference": f"Window {width:.0f}x{height:.0f}", "IsExternal": True},
        )
        product.OverallWidth, product.OverallHeight = width, height
        house.opening(wall.product, _hole(wall, along, sill, width, height), product)
    doors: list[tuple[str, str, float, float, float, float]] = [
        ("Entrance door", "North wall", 7200, 0, 1100, 2200),
        ("Terrace door", "South wall", 4800, 0, 1000, 2300),
        ("Living room door", "Living room wall", 5000, 0, 900, 2100),
        ("Kitchen passage door", "Living room wall", 1800, 0, 1000, 2100),
        ("Kitchen door", "Kitchen wall", 7300, 0, 900, 2100),
        ("Utility door", "Utility wall", 5400, 0, 800, 2100),
        ("Balcony door", "Upper south wall", 3500, UPPER, 1000, 2100),
        ("Bedroom door west", "Corridor wall", 3700, UPPER, 900, 2100),
        ("Bedroom door east", "Corridor wall", 5500, UPPER, 900, 2100),
        ("Bathroom door", "Bathroom wall", 5000, UPPER, 800, 2100),
    ]
    for name, host, along, sill, width, height in doors:
        wall = walls[host]
        outside = wall.thickness == OUTER
        glazed = name in ("Terrace door", "Balcony door")
        product = house.add(
            "IfcDoor", name, _door(width, height, glazed), upper if sill > CLEAR else ground,
            place=_in_wall(wall, along, sill), predefined="DOOR", type_class="IfcDoorType",
            type_name=f"{'Glazed' if glazed else 'Outer' if outside else 'Inner'} door {width:.0f}x{height:.0f}",
            material="Timber",
            common={"Reference": f"Door {width:.0f}x{height:.0f}", "IsExternal": outside},
        )
        product.OverallWidth, product.OverallHeight = width, height
        house.opening(wall.product, _hole(wall, along, sill, width, height), product)


def _in_wall(wall: _Wall, along: float, sill: float) -> Any:
    """Placement of a filling: its x axis along the wall, its y axis across it from its middle."""
    middle = wall.across + wall.thickness / 2
    if wall.along == "x":
        return at(along, middle, sill)
    return at(middle, along, sill, turn_deg=90.0)


def _hole(wall: _Wall, along: float, sill: float, width: float, height: float) -> Solid:
    deep = wall.thickness + 100
    if wall.along == "x":
        return box(along, wall.across - 50, sill, width, deep, height, "render")
    return box(wall.across - 50, along, sill, deep, width, height, "render")


def _window(width: float, height: float) -> list[Solid]:
    """Frame, mullion when wide, and panes, about the middle of the wall."""
    half = 40.0
    parts = _frame(width, height, half, "anthracite")
    panes = [(FRAME, width - FRAME)]
    if width > 1500:
        middle = width / 2
        parts.append(box(middle - FRAME / 2, -half, FRAME, FRAME, 2 * half, height - 2 * FRAME, "anthracite"))
        panes = [(FRAME, middle - FRAME / 2), (middle + FRAME / 2, width - FRAME)]
    for left, right in panes:
        parts.append(box(left, -PANE / 2, FRAME, right - left, PANE, height - 2 * FRAME, "glass"))
    return parts


def _frame(width: float, height: float, half: float, style: str) -> list[Solid]:
    return [
        box(0, -half, 0, FRAME, 2 * half, height, style),
        box(width - FRAME, -half, 0, FRAME, 2 * half, height, style),
        box(FRAME, -half, 0, width - 2 * FRAME, 2 * half, FRAME, style),
        box(FRAME, -half, height - FRAME, width - 2 * FRAME, 2 * half, FRAME, style),
    ]


def _door(width: float, height: float, glazed: bool) -> list[Solid]:
    """Frame without sill, leaf with handle; a glazed leaf has rails around its pane."""
    half, jamb = 50.0, 50.0
    parts = [
        box(0, -half, 0, jamb, 2 * half, height, "anthracite" if glazed else "white"),
        box(width - jamb, -half, 0, jamb, 2 * half, height, "anthracite" if glazed else "white"),
        box(jamb, -half, height - jamb, width - 2 * jamb, 2 * half, jamb, "anthracite" if glazed else "white"),
    ]
    wide, tall = width - 2 * jamb, height - jamb
    if glazed:
        rail = 110.0
        parts += [
            box(jamb, -30, 0, rail, 60, tall, "anthracite"),
            box(width - jamb - rail, -30, 0, rail, 60, tall, "anthracite"),
            box(jamb + rail, -30, 0, wide - 2 * rail, 60, rail, "anthracite"),
            box(jamb + rail, -30, tall - rail, wide - 2 * rail, 60, rail, "anthracite"),
            box(jamb + rail, -PANE / 2, rail, wide - 2 * rail, PANE, tall - 2 * rail, "glass"),
        ]
    else:
        parts.append(box(jamb, -22, 0, wide, 44, tall, "oak"))
    for side in (-90.0, 30.0):
        parts.append(box(width - jamb - 170, side, 1030, 120, 60, 25, "steel"))
    return parts


def _terrace(house: HouseBuilder, ground: Any, upper: Any) -> None:
    front = -2500.0
    for index, x in enumerate((1700.0, 3900.0, 6100.0, 8300.0)):
        house.add(
            "IfcColumn", f"Terrace column {index + 1}", [box(-90, -90, 0, 180, 180, 2460, "timber")], ground,
            place=at(x, front, -10), predefined="COLUMN", type_class="IfcColumnType", type_name="Timber column 180",
            material="Timber", common={"Reference": "180x180", "IsExternal": True, "LoadBearing": True},
        )
        house.add(
            "IfcBeam", f"Terrace joist {index + 1}", [box(x - 60, front + 90, 2450, 120, -front - 90, 200, "timber")],
            ground, predefined="JOIST", type_class="IfcBeamType", type_name="Timber joist 120x200", material="Timber",
            common={"Reference": "120x200", "IsExternal": True, "LoadBearing": True},
        )
    house.add(
        "IfcBeam", "Terrace front beam", [box(1400, front - 90, 2450, 7200, 180, 200, "timber")], ground,
        predefined="BEAM", type_class="IfcBeamType", type_name="Timber beam 180x200", material="Timber",
        common={"Reference": "180x200", "IsExternal": True, "LoadBearing": True},
    )
    house.add(
        "IfcSlab", "Balcony deck", [box(1300, front - 200, 2650, 7400, -front + 200, 160, "oak")], upper,
        predefined="FLOOR", material="Timber",
        common={"Reference": "Deck 160", "IsExternal": True, "LoadBearing": True},
    )
    edge = front - 140.0
    house.add(
        "IfcRailing", "Balcony railing front",
        _railing("x", edge, 1360, 8640, 2810, 7),
        upper, predefined="GUARDRAIL", material="Steel", common={"Reference": "Guard rail", "IsExternal": True},
    )
    for side, x in (("west", 1360.0), ("east", 8600.0)):
        house.add(
            "IfcRailing", f"Balcony railing {side}", _railing("y", x, edge + 40, 0, 2810, 3),
            upper, predefined="GUARDRAIL", material="Steel", common={"Reference": "Guard rail", "IsExternal": True},
        )
    house.add(
        "IfcSlab", "Entrance canopy", [box(6700, WIDTH, 2420, 2200, 1500, 100, "zinc")], ground, predefined="ROOF",
        material="Zinc", common={"Reference": "Canopy", "IsExternal": True, "LoadBearing": False},
    )
    for side, x in (("west", 6800.0), ("east", 8800.0)):
        house.add(
            "IfcColumn", f"Canopy post {side}", [tube(0, 0, "z", 0, 2480, 45, "steel")], ground,
            place=at(x, WIDTH + 1400, -60), predefined="COLUMN", type_class="IfcColumnType",
            type_name="Steel post 90", material="Steel",
            common={"Reference": "CHS 90", "IsExternal": True, "LoadBearing": True},
        )


def _railing(along: Axis, across: float, start: float, end: float, floor: float, posts: int) -> list[Solid]:
    """Posts, a hand rail and bars between them, 1 m high."""

    def bar(a: float, b: float, low: float, high: float, thick: float) -> Solid:
        if along == "x":
            return box(a, across, low, b - a, thick, high - low, "anthracite")
        return box(across, a, low, thick, b - a, high - low, "anthracite")

    step = (end - start - 40) / (posts - 1)
    parts = [bar(start + i * step, start + i * step + 40, floor, floor + 960, 40) for i in range(posts)]
    parts.append(bar(start, end, floor + 960, floor + 1000, 40))
    for left in range(posts - 1):
        a, b = start + left * step + 40, start + (left + 1) * step
        parts += [bar(a, b, floor + 140 + 160 * k, floor + 165 + 160 * k, 25) for k in range(5)]
    return parts


def _roof(house: HouseBuilder, upper: Any) -> None:
    roof = house.whole("Roof", "IfcRoof", upper, "GABLE_ROOF", {"Reference": "Gable 35", "IsExternal": True})
    over, low = -600.0, EAVES - 600.0 * PITCH
    side: list[Point] = [(over, low), (WIDTH / 2, RIDGE), (WIDTH / 2, RIDGE + ROOF_HEIGHT), (over, low + ROOF_HEIGHT)]
    for name, outline in (("south", side), ("north", [(WIDTH - y, z) for y, z in side])):
        house.add(
            "IfcSlab", f"Roof slope {name}", [prism(outline, "x", -450, LENGTH + 900, "tile")], roof, predefined="ROOF",
            material="Roof tiles on timber",
            common={"Reference": "Roof 220", "IsExternal": True, "LoadBearing": True, "PitchAngle": math.radians(35.0)},
        )
    panel = [box(0, 0, 0, 1050, 1700, 40, "solar")]
    for index in range(5):
        y = 900.0
        house.add(
            "IfcSolarDevice", f"Solar panel {index + 1}", panel, upper,
            place=at(2150 + index * 1120, y, _roof_underside(y) + ROOF_HEIGHT + 60, tilt_deg=35.0),
            predefined="SOLARPANEL", type_class="IfcSolarDeviceType", type_name="Solar panel 1050x1700",
            material="Solar glass",
        )


def _stair(house: HouseBuilder, ground: Any, upper: Any) -> None:
    risers, going, first = 16, 270.0, 730.0
    rise = UPPER / risers
    stair = house.whole("Stair", "IfcStair", ground, "STRAIGHT_RUN_STAIR", {"Reference": "Stair 16x184/270"})
    outline: list[Point] = [(first, 0.0)]
    for step in range(risers - 1):
        outline += [(first + step * going, (step + 1) * rise), (first + (step + 1) * going, (step + 1) * rise)]
    last = outline[-1]
    outline += [(last[0], last[1] - rise - 120), (first + going, 0.0)]
    flight = house.add(
        "IfcStairFlight", "Stair flight", [prism(outline, "y", 6200, 950, "oak")], stair, predefined="STRAIGHT",
        material="Timber",
    )
    if house.schema == "IFC2X3":
        flight.NumberOfRiser, flight.NumberOfTreads = risers, risers - 1
    else:
        flight.NumberOfRisers, flight.NumberOfTreads = risers, risers - 1
    flight.RiserHeight, flight.TreadLength = rise, going
    house.add(
        "IfcRailing", "Stair well railing", _railing("x", 6080, 1460, 5000, UPPER, 5),
        upper, predefined="GUARDRAIL", material="Steel", common={"Reference": "Guard rail", "IsExternal": False},
    )


def _ceilings_and_ducts(house: HouseBuilder, ground: Any) -> None:
    rooms = {
        "Kitchen ceiling": box(6550, OUTER, 2450, 3150, 3700, 25, "plaster"),
        "Hall ceiling": box(6550, 4150, 2450, 2050, 3050, 25, "plaster"),
    }
    for name, solid in rooms.items():
        house.add(
            "IfcCovering", name, [solid], ground, predefined="CEILING", material="Plasterboard",
            common={"Reference": "Suspended ceiling", "IsExternal": False},
        )
    height, radius = 2280.0, 110.0
    segments = {
        "Duct 1": tube(4700, height, "x", 4300, 2100, radius, "zinc"),
        "Duct 2": tube(4700, height, "x", 2200, 2080, radius, "zinc"),
        "Duct 3": tube(1900, height, "y", 1500, 2900, radius, "zinc"),
    }
    for name, solid in segments.items():
        house.add("IfcDuctSegment", name, [solid], ground, predefined="RIGIDSEGMENT", material="Steel, galvanised")
    fittings = {
        "Duct coupling": ([tube(4700, height, "x", 4280, 20, radius + 15, "steel")], "CONNECTOR"),
        "Duct bend": ([box(1900 - 150, 4700 - 300, height - 130, 450, 430, 260, "zinc")], "BEND"),
    }
    for name, (parts, kind) in fittings.items():
        house.add("IfcDuctFitting", name, parts, ground, predefined=kind, material="Steel, galvanised")
    house.add(
        "IfcAirTerminal", "Air outlet", [box(1750, 1300, height - 150, 300, 200, 300, "white")], ground,
        predefined="DIFFUSER", material="Steel, galvanised",
    )


def _furniture(house: HouseBuilder, ground: Any, upper: Any) -> None:
    pieces: list[tuple[str, list[Solid], Any]] = [
        ("Dining table", table(0, 0, 1900, 950, 740, "oak"), at(3600, 1500, 0)),
        *[(f"Chair {i + 1}", chair(), spot) for i, spot in enumerate((
            at(3850, 1420, 0), at(4800, 1420, 0), at(4300, 2530, 0, 180), at(5250, 2530, 0, 180),
        ))],
        ("Sofa", sofa(), at(700, 4100, 0, -90)),
        ("Sideboard", [box(0, 0, 0, 1800, 420, 620, "white")], at(2300, 5600, 0)),
        ("Kitchen counter", counter(), at(9690, 500, 0, 90)),
        ("Bookshelf", shelf(), at(620, 450, 0, 90)),
    ]
    for name, solids, place in pieces:
        _piece(house, name, solids, place, ground)
    level = UPPER
    _piece(house, "Double bed", bed(1600), at(400, 1500, level), upper)
    _piece(house, "Single bed", bed(1000), at(7500, 2600, level), upper)
    _piece(house, "Wardrobe", [box(0, 0, 0, 2000, 600, 2050, "oak")], at(1000, 3650, level), upper)
    _piece(house, "Desk", table(0, 0, 1400, 650, 740, "white"), at(5250, 700, level), upper)
    house.add(
        "IfcBuildingElementProxy", "Water tank",
        [tube(9250, 6700, "z", 120, 1600, 300, "white"), *[
            box(9250 + dx, 6700 + dy, 0, 60, 60, 120, "anthracite") for dx in (-190, 130) for dy in (-190, 130)
        ]],
        ground,
    )


def _piece(house: HouseBuilder, name: str, solids: Sequence[Solid], place: Any, storey: Any) -> None:
    house.add(
        "IfcFurniture", name, solids, storey, place=place, type_class="IfcFurnitureType",
        type_name=name.rstrip(" 1234"),
    )
