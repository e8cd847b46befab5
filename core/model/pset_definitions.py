"""What each of our property sets is, and what each of its properties means: the words for other tools."""

from __future__ import annotations

from ..results import LEVELS

LABEL, TEXT, RATIO, LENGTH, VOLUME, ANGLE, COUNT, FLAG, REAL = (
    "IfcLabel", "IfcText", "IfcNormalisedRatioMeasure", "IfcLengthMeasure", "IfcVolumeMeasure", "IfcPlaneAngleMeasure",
    "IfcInteger", "IfcBoolean", "IfcReal",
)
SOURCES = {
    "ScanSource": (LABEL, "Scan files"),
    "ScanDate": (LABEL, "When they were taken"),
    "Method": (LABEL, "Method and version"),
}  # fmt: skip
TEMPLATES: dict[str, tuple[str, dict[str, tuple[str, str]]]] = {
    "BimVerify_Verification": (
        "Does the as-built evidence confirm the element",
        {
            "Status": (LABEL, "CONFIRMED, DEVIATING, ABSENT (seen through), PARTIAL or NOTOBSERVED (nothing known)"),
            "RequiredLOA": (LABEL, "Level of accuracy asked for, LOA10 to LOA50"),
            "AchievedLOA": (LABEL, "Highest level that 70 % of the observed surface reaches, or NONE"),
            "BeliefOccupied": (RATIO, "Belief that the planned surface is there, mean over the surface"),
            "BeliefEmpty": (RATIO, "Belief that nothing is there, mean over the surface"),
            "BeliefUnknown": (RATIO, "What the scans leave open; the three beliefs add up to 1"),
            "Conflict": (RATIO, "Mass on which the evidence contradicts itself"),
            "Coverage": (RATIO, "Share of the exposed surface with evidence"),
            **{f"ConfirmedRatioLOA{n}": (RATIO, f"Share of the observed surface confirmed at LOA{n}") for n in LEVELS},
            "SampleCount": (COUNT, "Query positions on the element"),
            "DeviationMedian": (LENGTH, "Of the scan from the planned surface along its outward normal, signed"),
            "DeviationP95": (LENGTH, "95 % of the absolute deviations are smaller"),
            "Displacement": (LENGTH, "Rigid shift of the built element against the plan"),
            "DisplacementX": (LENGTH, "Along the model's x axis, where the scan determines it"),
            "DisplacementY": (LENGTH, "Along the model's y axis, where the scan determines it"),
            "DisplacementZ": (LENGTH, "Along the model's z axis, where the scan determines it"),
            "DisplacementSigma": (LENGTH, "One standard deviation along the shift, registration included"),
            "Significant": (FLAG, "The shift differs from zero at 95 %"),
            "MeasurementSigma": (LENGTH, "Standard deviation of one return that the test counted"),
            "RegistrationSigma": (LENGTH, "Standard deviation of a station's position that the test counted"),
            **SOURCES,
        },
    ),
    "BimVerify_Decision": (
        "What a person decided instead of the computed verdict",
        {
            "Status": (LABEL, "The verdict that holds"),
            "Reason": (TEXT, "Why it was decided so"),
            "DecidedBy": (LABEL, "Who decided"),
            "DecidedOn": (LABEL, "The day, ISO 8601"),
            "ComputedStatus": (LABEL, "The verdict that was overruled"),
        },
    ),
    "BimVerify_Change": (
        "What became of the element between the epochs, or against the plan",
        {
            "State": (LABEL, "CONFIRMED, NEW, DISAPPEARED, PARTIAL or UNKNOWN"),
            "ConfirmedRatio": (RATIO, "Share of the planned volume that is there in both; the four shares add up to 1"),
            "DisappearedRatio": (RATIO, "Share of the planned volume that was there and is gone"),
            "NewRatio": (RATIO, "Share of the planned volume that was not there and is now"),
            "UnknownRatio": (RATIO, "Share of the planned volume that was not seen"),
            "DisappearedVolume": (VOLUME, "Planned volume that is gone"),
            "BuiltVolume": (VOLUME, "Planned volume that is there"),
            "ExpectedState": (LABEL, "What the plan says for the date of the scan, in the words of State"),
            "Agrees": (FLAG, "What was seen is what was expected; left out where nothing was seen"),
            "Progress": (LABEL, "On time, early, late, not built, should be gone, cannot tell"),
            "VoxelSize": (LENGTH, "Edge of a voxel"),
            "Epoch": (LABEL, "Date and files of the epoch"),
            "ReferenceEpoch": (LABEL, "Date and files of the epoch compared with, or: model"),
            "Method": (LABEL, "Method and version"),
        },
    ),
    "BimVerify_ScanQuality": (
        "What the scans are worth for the element",
        {
            "PointSpacing": (LENGTH, "Median distance between the returns of all stations together"),
            "PointSpacingP95": (LENGTH, "95 % of the distances are smaller"),
            "Noise": (LENGTH, "Standard deviation of the returns from local planes, along the normal"),
            "EdgeNoise": (LENGTH, "Standard deviation of the returns near edges"),
            "EdgeNoiseShape": (REAL, "Shape of their distribution: 2 normal, 1 Laplace"),
            "Coverage": (RATIO, "Share of the exposed surface with returns"),
            "OccludedRatio": (RATIO, "Share of the exposed surface without returns because something stands before it"),
            "OutOfRangeRatio": (RATIO, "The same because it is too far from every station"),
            "GrazingRatio": (RATIO, "The same because rays meet it at too flat an angle"),
            "AbsorbedRatio": (RATIO, "The same because rays that met it did not come back"),
            "OutsideViewRatio": (RATIO, "The same because no scanner's field of view holds it"),
            "SeenThroughRatio": (RATIO, "The same because rays passed the place"),
            "LargestOccluder": (LABEL, "What hides most of it"),
            "IncidenceP95": (ANGLE, "95 % of the surface is met at a smaller angle from its normal, by the best station"),
            "RangeMedian": (LENGTH, "Median distance from the scanner"),
            "RegistrationResidual": (LENGTH, "Standard deviation of a station against the others, beyond noise"),
            "BuiltOffset": (LENGTH, "Its largest face was found so far before its plan, and measured there"),
            "PredictedError": (LENGTH, "Expected error of an as-built model made from these scans"),
            "GsaLevel": (COUNT, "Level of detail (GSA) that the scans support, 0 for none to 4"),
            "SupportedLOA": (LABEL, "Level of accuracy that the scans support, LOA10 to LOA50, or NONE"),
            "CorrectiveAction": (LABEL, "What would help: AO, RA, RD, IN, IR; or NONE"),
            **SOURCES,
        },
    ),
    "BimVerify_Reconstruction": (
        "How well a reconstructed element is known",
        {
            "FitMean": (LENGTH, "Mean absolute distance of its returns from its faces"),
            "FitSigma": (LENGTH, "Standard deviation of its returns from its faces"),
            "Quality": (RATIO, "Share of its surface that was seen"),
            "PositionSigma": (LENGTH, "Standard deviation of its place: a wall's axis, a slab's surface, a column's middle"),
            "ThicknessSource": (LABEL, "MEASURED (both sides), REVEAL (of an opening), EDGES (of the faces beside) or ASSUMED"),
            "StartEdgeSigma": (LENGTH, "Standard deviation of an opening's edge at the start of its wall's axis"),
            "EndEdgeSigma": (LENGTH, "Standard deviation of an opening's edge at the end of its wall's axis"),
            "SillSigma": (LENGTH, "Standard deviation of an opening's lower edge"),
            "HeadSigma": (LENGTH, "Standard deviation of an opening's upper edge"),
            "HiddenEdges": (LABEL, "Edges of an opening that were not seen: start, end, sill, head; or none"),
            "HeightSource": (LABEL, "Of a wall, column or space: MEASURED between floor and ceiling, SEEN, or ASSUMED"),
            "HiddenFaces": (LABEL, "Sides of a column that were not seen: left, right, front, back; or none"),
            "Method": (LABEL, "Method and version"),
        },
    ),
    "BimVerify_Displacement": (
        "How a panelled wall moved between two scans",
        {
            "ColumnCount": (COUNT, "Columns of panels"),
            "JointCount": (COUNT, "Joints that both epochs show"),
            "NewJointCount": (COUNT, "Joints of the later epoch only"),
            "MissingJointCount": (COUNT, "Joints of the base epoch only"),
            "VerticalMean": (LENGTH, "Mean movement of the joints, upwards positive"),
            "VerticalLargest": (LENGTH, "Movement of the joint that moved most upwards or downwards"),
            "VerticalSigma": (LENGTH, "Standard deviation of that movement"),
            "LateralMean": (LENGTH, "Mean movement of the joints out of the wall"),
            "LateralLargest": (LENGTH, "Movement of the joint that moved most out of or into the wall"),
            "LateralSigma": (LENGTH, "Standard deviation of that movement"),
            "BowLargest": (LENGTH, "Largest change of a column from the straight line between its ends"),
            "DetectionLevel": (LENGTH, "Median of the levels of detection between the joints, 95 %"),
            "SignificantRatio": (RATIO, "Share of the places between the joints that moved by more than that"),
            "MovedColumnCount": (COUNT, "Columns whose joints together moved at 95 %"),
            "Significant": (FLAG, "A column moved at 95 %"),
            "RegistrationSigma": (LENGTH, "Standard deviation of the registration between the epochs that the tests counted"),
            "BaseSource": (LABEL, "Scan files of the base epoch"),
            "LaterSource": (LABEL, "Scan files of the later epoch"),
            "BaseDate": (LABEL, "When the base epoch was scanned"),
            "LaterDate": (LABEL, "When the later epoch was scanned"),
        },
    ),
    "BimVerify_Facade": (
        "What a wall, a window or a door of a facade mock-up was read from, and how well it is known",
        {
            "Image": (LABEL, "The photo; on walls"),
            "ScaleSource": (LABEL, "What the scale was taken from; on walls"),
            "CornerSource": (LABEL, "GIVEN, or LINES where the facade's corners were found by its lines; on walls"),
            "ScaleSigma": (RATIO, "Relative standard deviation of the scale; on walls"),
            "AspectSigma": (RATIO, "Relative standard deviation of height over width; on walls"),
            "FacadeWidth": (LENGTH, "Width of the rectified facade; on walls"),
            "FacadeHeight": (LENGTH, "Height of the rectified facade; on walls"),
            "Arrangement": (LABEL, "Connected or separated, along x and z; on walls"),
            "Grammar": (TEXT, "Split grammar of the facade, one rule a line; on walls"),
            "Shape": (LABEL, "ARCHED or RECTANGULAR; on windows and doors"),
            "WidthSigma": (LENGTH, "Standard deviation of the width; on windows and doors"),
            "HeightSigma": (LENGTH, "Standard deviation of the height; on windows and doors"),
            "Inferred": (FLAG, "Put in from the pattern where plants hide it; on windows and doors"),
            "Method": (LABEL, "Method and version"),
        },
    ),
    "BimVerify_Update": (
        "How an element was brought to its as-built place; what takes it back",
        {
            "Kind": (LABEL, "MOVED by its own displacement, FOLLOWS another one, or KEPT its place though its host moved"),
            "Follows": (LABEL, "GlobalId of what it followed"),
            **{f"Previous{a}": (LENGTH, f"{a} of its local placement before the first update") for a in "XYZ"},
            **{f"Moved{a}": (LENGTH, f"How far it went in all along the model's {a.lower()} axis") for a in "XYZ"},
            **{f"Applied{a}": (LENGTH, f"The displacement applied last, along the model's {a.lower()} axis") for a in "XYZ"},
            **SOURCES,
        },
    ),
    "BimVerify_Station": (
        "A planned scanner position",
        {
            "Scanner": (LABEL, "Preset of the scanner"),
            "Minutes": (REAL, "Time that the set-up takes, minutes"),
            "CorrectiveAction": (LABEL, "What it is for: AO, RA, RD, IN, IR; or NONE"),
            "LinkedTo": (LABEL, "Stations that it shares enough surface with to be registered to; or NONE"),
        },
    ),
}  # fmt: skip
"""Set -> (what it is, property -> (IFC type, meaning)). A length is in the unit of the file that carries the set."""

UNITS = {
    RATIO: "0 to 1",
    LENGTH: "in the file's unit of length",
    VOLUME: "in the file's unit of volume",
    ANGLE: "in the file's unit of angle",
}
"""IFC type -> what is said of the unit."""


def described(kind: str, meaning: str) -> str:
    """The meaning of a property, with its unit."""
    return f"{meaning} ({UNITS[kind]})" if kind in UNITS else meaning
