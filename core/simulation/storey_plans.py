"""Plans of the storeys that benchmarks and tests of reconstruction scan."""

from __future__ import annotations

from .storeys import Filling, Furniture, PlannedOpening, PlannedStorey, PlannedWall


def door(at: float, width: float = 0.9, height: float = 2.1, filling: Filling = "ajar") -> PlannedOpening:
    """A door: closed, ajar (standing open) or none (an opening without a leaf)."""
    return PlannedOpening(at, width, 0.0, height, filling)


def window(at: float, width: float = 1.4, sill: float = 0.9, height: float = 1.3) -> PlannedOpening:
    """A window with frame and pane."""
    return PlannedOpening(at, width, sill, height, "window")


def offices() -> PlannedStorey:
    """Five rooms and a corridor, 14 m x 9 m, right-angled, thick outer walls; scanned from inside only."""
    t = 0.06
    outline = ((0.0, 0.0), (14.0, 0.0), (14.0, 9.0), (0.0, 9.0))
    walls = (
        PlannedWall("Corridor south", (0.0, 3.9), (14.0, 3.9), t, t,
                    (door(2.0), door(7.5, filling="none"), door(12.0, filling="closed"))),
        PlannedWall("Corridor north", (0.0, 5.5), (14.0, 5.5), t, t, (door(3.0, filling="closed"), door(10.0))),
        PlannedWall("Partition 1", (5.0, 0.0), (5.0, 3.84), t, t),
        PlannedWall("Partition 2", (9.5, 0.0), (9.5, 3.84), t, t, (door(2.9),)),
        PlannedWall("Partition 3", (7.0, 5.56), (7.0, 9.0), 0.09, 0.09),
    )
    rooms = (
        ((0, 0), (4.94, 0), (4.94, 3.84), (0, 3.84)), ((5.06, 0), (9.44, 0), (9.44, 3.84), (5.06, 3.84)),
        ((9.56, 0), (14, 0), (14, 3.84), (9.56, 3.84)), ((0, 3.96), (14, 3.96), (14, 5.44), (0, 5.44)),
        ((0, 5.56), (6.91, 5.56), (6.91, 9), (0, 9)), ((7.09, 5.56), (14, 5.56), (14, 9), (7.09, 9)),
    )
    furniture = (
        Furniture("Cabinet", (0.3, 1.0), (0.45, 1.2, 1.9)), Furniture("Table", (2.6, 1.4), (1.6, 0.8, 0.04), 0.72),
        Furniture("Wardrobe", (5.4, 2.8), (0.6, 1.4, 2.2)), Furniture("Desk", (8.2, 0.6), (1.6, 0.8, 0.74)),
        Furniture("Shelf", (13.8, 2.6), (0.35, 1.2, 2.0)), Furniture("Sofa", (11.6, 0.7), (2.0, 0.9, 0.8)),
        Furniture("Filing", (13.7, 4.5), (0.5, 0.4, 1.3)), Furniture("Bed", (1.2, 7.9), (2.0, 1.6, 0.5)),
        Furniture("Wardrobe", (6.55, 7.0), (0.6, 1.8, 2.3)), Furniture("Table", (10.5, 7.2), (2.4, 1.0, 0.74), 0.0),
        Furniture("Lamp", (10.5, 7.2), (0.4, 0.4, 0.12), 2.2), Furniture("Screen", (3.4, 3.6), (1.2, 0.1, 1.6), 0.0, 8.0),
    )  # fmt: skip
    return PlannedStorey(
        "Ground floor", 2.7, outline, 0.36,
        {0: (window(2.0), window(7.2, 1.8), window(11.6)), 1: (window(2.0, 1.0), window(7.2)),
         2: (window(3.5, 2.0), window(10.0)), 3: (window(1.6, 1.0, 1.0, 1.2), door(4.3, 1.0, 2.1, "closed"))},
        walls, rooms, (), furniture,
        ((2.6, 2.4, 1.55), (7.3, 2.0, 1.6), (11.4, 2.2, 1.5), (3.5, 4.6, 1.6), (10.2, 4.8, 1.6), (3.4, 6.8, 1.55),
         (9.0, 7.9, 1.6), (12.6, 6.3, 1.5)),
    )


def slanted() -> PlannedStorey:
    """An L-shaped building with a slanted side, an L-shaped room, columns; walls of several thicknesses."""
    outline = ((0.0, 0.0), (11.0, 0.0), (12.6, 5.0), (6.5, 5.0), (6.5, 9.5), (0.0, 9.5))
    walls = (
        PlannedWall("Wall A", (6.0, 0.0), (6.0, 5.0), 0.12, 0.12, (door(1.4, 1.0, 2.2),)),
        PlannedWall("Wall B", (0.0, 5.12), (6.5, 5.12), 0.12, 0.12, (door(2.0, 0.85, 2.05, "closed"), door(5.0, 0.9))),
        PlannedWall("Wall C", (2.8, 5.24), (2.8, 9.5), 0.05, 0.05, (door(3.4, 0.8, 2.05, "none"),)),
    )
    rooms = (
        ((0, 0), (5.88, 0), (5.88, 5.0), (0, 5.0)),
        ((6.12, 0), (11, 0), (12.6, 5.0), (6.12, 5.0)),
        ((0, 5.24), (2.75, 5.24), (2.75, 9.5), (0, 9.5)),
        ((2.85, 5.24), (6.5, 5.24), (6.5, 9.5), (2.85, 9.5)),
    )
    furniture = (
        Furniture("Cupboard", (0.35, 2.4), (0.5, 1.6, 2.1)), Furniture("Table", (3.0, 2.2), (1.8, 0.9, 0.75)),
        Furniture("Counter", (8.4, 4.6), (2.0, 0.6, 0.9)), Furniture("Cupboard", (8.4, 4.82), (2.0, 0.34, 0.7), 1.5),
        Furniture("Bed", (1.2, 8.4), (1.6, 2.0, 0.5)), Furniture("Shelf", (4.4, 9.3), (1.2, 0.3, 1.8)),
        Furniture("Box", (9.4, 1.4), (0.6, 0.5, 0.6), 0.0, 30.0), Furniture("Chair", (3.1, 3.2), (0.5, 0.5, 0.9), 0.0, 15.0),
    )  # fmt: skip
    return PlannedStorey(
        "Ground floor", 2.95, outline, 0.30,
        {0: (window(3.0, 2.2, 0.6, 1.8), window(8.2, 1.2)), 1: (window(2.4, 1.6),),
         3: (door(2.2, 1.1, 2.2, "closed"),), 4: (window(1.6, 1.0), window(5.0, 1.0)), 5: (window(2.2), window(6.8, 1.8))},
        walls, rooms, ((3.9, 3.6, 0.3, 0.3), (8.0, 2.4, 0.35, 0.35)), furniture,
        ((1.8, 3.3, 1.5), (4.8, 1.4, 1.6), (7.6, 1.3, 1.6), (10.2, 3.6, 1.55), (1.4, 6.5, 1.5), (4.8, 7.4, 1.6)),
    )


def flat() -> PlannedStorey:
    """A small upper storey: an L-shaped living room around a bath, a hall and a bedroom; thin walls."""
    outline = ((0.0, 0.0), (8.4, 0.0), (8.4, 7.2), (0.0, 7.2))
    walls = (
        PlannedWall("Bath south", (0.0, 4.6), (2.64, 4.6), 0.04, 0.04, (door(1.9, 0.75, 2.0, "closed"),)),
        PlannedWall("Bath east", (2.6, 4.64), (2.6, 7.2), 0.04, 0.04),
        PlannedWall("Bedroom", (5.0, 0.0), (5.0, 7.2), 0.075, 0.075, (door(2.2, 0.85), door(5.8, 0.85, 2.1, "closed"))),
        PlannedWall("Store", (5.075, 3.6), (8.4, 3.6), 0.075, 0.075, ()),
    )
    rooms = (
        ((0, 0), (4.925, 0), (4.925, 7.2), (2.64, 7.2), (2.64, 4.56), (0, 4.56)),
        ((0, 4.64), (2.56, 4.64), (2.56, 7.2), (0, 7.2)),
        ((5.075, 0), (8.4, 0), (8.4, 3.525), (5.075, 3.525)),
        ((5.075, 3.675), (8.4, 3.675), (8.4, 7.2), (5.075, 7.2)),
    )
    furniture = (
        Furniture("Sofa", (0.6, 2.2), (0.9, 2.0, 0.8)), Furniture("Shelf", (2.2, 0.2), (1.8, 0.35, 2.0)),
        Furniture("Table", (3.4, 5.9), (0.9, 1.4, 0.74)), Furniture("Tub", (0.5, 5.6), (0.7, 1.7, 0.55)),
        Furniture("Wardrobe", (8.05, 1.2), (0.6, 2.0, 2.25)), Furniture("Bed", (6.4, 0.95), (1.6, 1.8, 0.5)),
        Furniture("Desk", (7.6, 6.7), (1.4, 0.7, 0.74)), Furniture("Cabinet", (5.4, 4.6), (0.4, 0.9, 1.2)),
    )  # fmt: skip
    return PlannedStorey(
        "Upper floor", 2.5, outline, 0.24,
        {0: (window(3.6, 1.6), window(6.9, 1.2)), 1: (window(1.8, 1.2), window(5.6)),
         2: (window(1.6, 1.2), window(4.6, 2.0, 0.5, 1.7)), 3: (window(1.2, 0.6, 1.4, 0.7), window(5.2, 1.6))},
        walls, rooms, (), furniture,
        ((2.0, 2.8, 1.5), (3.8, 4.7, 1.6), (1.7, 5.4, 1.5), (6.0, 2.6, 1.6), (6.6, 5.4, 1.55)),
    )


def lined() -> PlannedStorey:
    """Two rooms with what lies flat on walls or in them: a board, a lining, a wainscot, skirting, recesses, a bare hatch."""
    outline = ((0.0, 0.0), (9.0, 0.0), (9.0, 5.0), (0.0, 5.0))
    partition = PlannedWall(
        "Partition", (5.0, 0.0), (5.0, 5.0), 0.05, 0.05,
        (door(1.0, filling="none"), PlannedOpening(3.4, 1.2, 1.0, 0.9, "none")),
    )  # fmt: skip
    rooms = (((0, 0), (4.95, 0), (4.95, 5), (0, 5)), ((5.05, 0), (9, 0), (9, 5), (5.05, 5)))
    flat_things = (
        Furniture("Whiteboard", (2.4, 4.99), (2.0, 0.02, 1.2), 0.9), Furniture("Lining", (7.0, 4.99), (0.9, 0.02, 2.7)),
        Furniture("Wainscot", (7.025, 0.015), (3.95, 0.03, 0.9)), Furniture("Skirting", (0.0075, 2.5), (0.015, 5.0, 0.1)),
    )  # fmt: skip
    return PlannedStorey(
        "Lined", 2.7, outline, 0.3,
        {0: (window(2.5), window(7.0)), 1: (PlannedOpening(3.2, 1.2, 0.0, 2.1, "none", 0.12),),
         3: (PlannedOpening(2.5, 1.0, 0.5, 1.6, "none", 0.2),)},
        (partition,), rooms, (), flat_things,
        ((1.5, 1.2, 1.5), (3.8, 3.6, 1.55), (6.3, 1.4, 1.5), (7.6, 3.7, 1.55)),
    )
