"""Property set templates: what each of our properties means, for tools that show descriptions and units from them."""

from __future__ import annotations

from pathlib import Path

from ..errors import BimVerifyError
from ..files import whole_file
from ..results import LEVELS

LABEL, TEXT, RATIO, LENGTH, COUNT, FLAG = (
    "IfcLabel", "IfcText", "IfcNormalisedRatioMeasure", "IfcLengthMeasure", "IfcInteger", "IfcBoolean",
)  # fmt: skip
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
            "ScanSource": (LABEL, "Scan files"),
            "ScanDate": (LABEL, "When they were taken"),
            "Method": (LABEL, "Method and version"),
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
}  # fmt: skip
"""Set -> (what it is, property -> (IFC type, meaning)). A length is in the unit of the file that carries the set."""


def write_templates(path: str | Path, schema: str = "IFC4") -> int:
    """Write an IFC library of the templates and return how many sets it has; IFC2X3 has none to write."""
    import ifcopenshell.api.project
    import ifcopenshell.api.pset_template
    import ifcopenshell.api.root

    if not schema.startswith("IFC4"):
        raise BimVerifyError(f"{schema} has no property set templates; write them as IFC4.")
    file = ifcopenshell.api.project.create_file(version="IFC4")
    ifcopenshell.api.root.create_entity(file, ifc_class="IfcProjectLibrary", name="bim_verify property sets")
    for name, (meaning, properties) in TEMPLATES.items():
        made = ifcopenshell.api.pset_template.add_pset_template(
            file, name=name, template_type="PSET_OCCURRENCEDRIVEN", applicable_entity="IfcObject"
        )
        made.Description = meaning
        for prop, (kind, description) in properties.items():
            ifcopenshell.api.pset_template.add_prop_template(
                file, pset_template=made, name=prop, description=description, primary_measure_type=kind
            )
    with whole_file(path) as temporary:
        file.write(str(temporary))
    return len(TEMPLATES)
