"""What a verification can be written as for other tools; options of ``verify``."""

from __future__ import annotations

from ..progress import Progress
from ..results import VerificationResult
from .table import Argument, Values

ARGUMENTS = (
    Argument("--bcf", "BCF file (.bcf) with one topic a finding: camera, picture, GlobalId"),
    Argument("--bcf-version", "version of the BCF file", str, "3.0", ("3.0", "2.1")),
    Argument("--ids", "IDS file that checks the deliverable: property sets there, levels reached"),
    Argument("--csv", "CSV file with one line an element"),
    Argument("--xlsx", "Excel workbook with one line an element"),
    Argument("--templates", "IFC library of property set templates (descriptions, units)"),
)
KEYS = ("bcf", "ids", "csv", "xlsx", "templates")
"""Of the options that name a file."""


def lines(values: Values, result: VerificationResult) -> list[str]:
    """A line for a person each."""
    from ..exchange.findings import findings

    said = {"bcf": "BCF", "ids": "IDS", "csv": "CSV", "xlsx": "Workbook", "templates": "Property set templates"}
    count = {"bcf": f", {len(findings(result))} topics"}
    return [f"{label}: {values[key]}{count.get(key, '')}" for key, label in said.items() if values[key]]


def write(values: Values, result: VerificationResult, progress: Progress) -> None:
    """Write what was asked for."""
    from ..exchange.bcf import write_bcf
    from ..exchange.ids import write_ids
    from ..exchange.xlsx import write_xlsx
    from ..model.pset_templates import write_templates
    from ..report.csv_out import write_csv

    if values["bcf"]:
        write_bcf(values["bcf"], result, version=values["bcf_version"], progress=progress)
    if values["ids"]:
        write_ids(values["ids"], result)
    if values["csv"]:
        write_csv(values["csv"], result)
    if values["xlsx"]:
        write_xlsx(values["xlsx"], result)
    if values["templates"]:
        write_templates(values["templates"])
