"""Settings that a panel has and its operator too: declared once, mixed into the property group and into the operator.

``Job.panel_settings`` names them; what the caller of an operator does not say is as the panel has it.
"""

from __future__ import annotations

from pathlib import Path

from bpy.props import BoolProperty, FloatProperty, StringProperty

LOA_ITEMS = [
    ("10", "LOA10", "Within 5 cm to 15 cm (95 %)"),
    ("20", "LOA20", "Within 15 mm to 5 cm (95 %)"),
    ("30", "LOA30", "Within 5 mm to 15 mm (95 %)"),
    ("40", "LOA40", "Within 1 mm to 5 mm (95 %)"),
    ("50", "LOA50", "Within 1 mm (95 %)"),
]


class IfcToWrite:
    """The IFC file that an operator writes, as the file browser asks for it."""

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The IFC file to write")
    filter_glob: StringProperty(default="*.ifc", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})


class ReportBeside:
    """A report in a folder beside the file that is written."""

    with_report: BoolProperty(
        name="Report", default=False, description="Also write a report, into a folder of its own beside the file"
    )

    def report_folder(self, path: Path) -> Path | None:
        """``wall.csv`` has its report in ``wall_report``; None where none is wanted."""
        return path.with_name(f"{path.stem}_report") if self.with_report else None


class KnownRegistration:
    """What is known of how well the stations are registered."""

    registration_known: BoolProperty(
        name="Registration known", default=False,
        description="Give the standard deviation of the stations' positions instead of estimating it from their agreement",
    )
    registration_sigma_mm: FloatProperty(
        name="Registration sigma (mm)", default=1.0, min=0.0, max=999.0, soft_max=50.0, precision=2,
        description="Standard deviation of a station's position, millimetres; zero for exact poses",
    )

    def known_sigma(self) -> float | None:
        """Metres; None where it is to be estimated."""
        return self.registration_sigma_mm / 1000 if self.registration_known else None

    def take_sigma(self, sigma: float | None) -> None:
        """As a result was made with it, metres."""
        self.registration_known = sigma is not None
        if sigma is not None:
            self.registration_sigma_mm = 1000 * sigma


class ReconstructOutputs(ReportBeside):
    """What else a reconstruction writes, and what it is compared with."""

    with_dimensions: BoolProperty(
        name="Dimensions", default=False,
        description="Also write a CSV beside the file (_dimensions): rooms and openings with 95 % intervals, corners, tests",
    )
    reference: StringProperty(
        name="Compare with", subtype="FILE_PATH", description="IFC file that what was made is compared with; empty for none"
    )


class ClassifyChoices:
    """How returns are assigned and written."""

    as_built: BoolProperty(
        name="As built", default=False,
        description="Verify first, and look for moved elements where they stand and not for absent ones",
    )
    per_station: BoolProperty(
        name="A scan per station", default=False,
        description="E57: one scan for each element and station, with that station's pose",
    )


class FacadeInputs:
    """What is known of the facades in the photos."""

    width: FloatProperty(name="Width", unit="LENGTH", min=0.0, description="Of the facade, metres; zero: not known")
    height: FloatProperty(name="Height", unit="LENGTH", min=0.0, description="Of the facade, metres; zero: not known")
    floor_height: FloatProperty(
        name="Floor height", unit="LENGTH", min=0.0, description="Floor to floor, metres; zero: not known"
    )
    corners: StringProperty(
        name="Corners",
        description="X,Y,X,Y,X,Y,X,Y of the facade in pixels of the photo, those of several divided by ; - empty: found by "
        "vanishing lines",
    )
    footprint: StringProperty(
        name="Footprint", subtype="FILE_PATH",
        description="Outline of the building, X,Y X,Y X,Y counter-clockwise in metres, or a GeoJSON file; the photos, by name, "
        "are of its edges in order",
    )
    crs: StringProperty(name="Map", description="Of a footprint in map coordinates, as EPSG:25832; empty: not known")


class WallChoice:
    """Which wall of the scans is meant."""

    element: StringProperty(
        name="Element",
        description="GlobalId of the wall in the model, in the scans' frame: it gets the property set; empty: the largest "
        "upright surface",
    )
    near: StringProperty(
        name="Near", description="X,Y,Z of a point on the wall in metres, where the scans hold several; empty: the largest"
    )
