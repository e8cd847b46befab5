"""An IDS that checks a deliverable: our property set is on every physical element, and each reaches its level.

IDS 1.0 (buildingSMART). It is made for the classes and levels of one result, and any IDS checker can run it on the file
that ``verify`` wrote, or on one that somebody changed later.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from ..errors import BimVerifyError
from ..files import whole_file
from ..model.write_psets import PSET_NAME, verification_properties
from ..results import LEVELS, STATUSES, VerificationResult
from .findings import plain_text

IDS = "http://standards.buildingsmart.org/IDS"
XS = "http://www.w3.org/2001/XMLSchema"
XSI = "http://www.w3.org/2001/XMLSchema-instance"
SCHEMAS = "IFC2X3 IFC4 IFC4X3_ADD2"
ALWAYS = (
    "Status", "RequiredLOA", "AchievedLOA", "BeliefOccupied", "BeliefEmpty", "BeliefUnknown", "Conflict", "Coverage",
    "SampleCount", "MeasurementSigma", "RegistrationSigma", "Method",
)  # fmt: skip
"""Properties that every verified element has."""

Node = ElementTree.Element


def write_ids(path: str | Path, result: VerificationResult) -> None:
    """Write the IDS for the classes and levels of ``result``; BimVerifyError when ``path`` cannot be written."""
    if not result.verdicts:
        raise BimVerifyError("The model has no elements with a body, so there is nothing an IDS could ask for.")
    for prefix, uri in (("", IDS), ("xs", XS), ("xsi", XSI)):
        ElementTree.register_namespace(prefix, uri)
    root = Node(f"{{{IDS}}}ids", {f"{{{XSI}}}schemaLocation": f"{IDS} {IDS}/1.0/ids.xsd"})
    info = _add(root, "info")
    for name, text in (
        ("title", "As-built verification"),
        ("description", "Every physical element carries the verification and reaches the level of accuracy required of it."),
        ("purpose", "As-built quality control"),
    ):
        _add(info, name).text = text
    specifications = _add(root, "specifications")
    _given(specifications, result)
    for level in sorted({int(v.required_loa.removeprefix("LOA")) for v in result.verdicts}):
        _reached(specifications, level)
    ElementTree.indent(root)
    with whole_file(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


def _given(parent: Node, result: VerificationResult) -> None:
    """Asked of every element of a class; of a class that also has wholes without a body, of the verified ones by GlobalId."""
    partly = set(result.model.partly)
    whole = sorted({v.ifc_class for v in result.verdicts} - partly)
    if whole:
        _ask(parent, "Verification is given", result, whole)
    for ifc_class in sorted(partly):
        own = sorted({v.global_id for v in result.verdicts if v.ifc_class == ifc_class})
        _ask(parent, f"Verification is given, {ifc_class} with a body", result, [ifc_class], own)


def _ask(
    parent: Node, title: str, result: VerificationResult, classes: Sequence[str], global_ids: Sequence[str] = ()
) -> None:
    applies, requires = _specification(parent, title, f"Physical elements carry {PSET_NAME} with typed values.", least="1")
    _restriction(_add(_add(applies, "entity"), "name"), [c.upper() for c in classes])
    if global_ids:
        identity = _add(applies, "attribute")
        _add(_add(identity, "name"), "simpleValue").text = "GlobalId"
        _restriction(_add(identity, "value"), [plain_text(g) for g in global_ids])
    for prop, (kind, _) in verification_properties(result.verdicts[0], "", "", "").items():
        if prop in ALWAYS:
            _property(requires, prop, kind, STATUSES if prop == "Status" else (), required=True)


def _reached(parent: Node, level: int) -> None:
    applies, requires = _specification(
        parent, f"LOA{level} is reached",
        f"Elements of which LOA{level} is required reach it. One that was not observed reaches none: scan it.",
    )  # fmt: skip
    _property(applies, "RequiredLOA", "IfcLabel", (f"LOA{level}",))
    enough = tuple(f"LOA{other}" for other in LEVELS if other >= level)
    _property(requires, "AchievedLOA", "IfcLabel", enough, required=True)


def _specification(parent: Node, name: str, description: str, least: str = "0") -> tuple[Node, Node]:
    node = _add(parent, "specification", name=name, ifcVersion=SCHEMAS, description=description)
    return _add(node, "applicability", minOccurs=least, maxOccurs="unbounded"), _add(node, "requirements")


def _property(parent: Node, name: str, kind: str, values: Sequence[str], *, required: bool = False) -> None:
    node = _add(parent, "property", dataType=kind.upper(), **({"cardinality": "required"} if required else {}))
    _add(_add(node, "propertySet"), "simpleValue").text = PSET_NAME
    _add(_add(node, "baseName"), "simpleValue").text = name
    if len(values) == 1:
        _add(_add(node, "value"), "simpleValue").text = values[0]
    elif values:
        _restriction(_add(node, "value"), values)


def _restriction(parent: Node, values: Sequence[str]) -> None:
    node = ElementTree.SubElement(parent, f"{{{XS}}}restriction", base="xs:string")
    for value in values:
        ElementTree.SubElement(node, f"{{{XS}}}enumeration", value=value)


def _add(parent: Node, tag: str, **attributes: str) -> Node:
    return ElementTree.SubElement(parent, f"{{{IDS}}}{tag}", attributes)
