"""Property set templates: what each of our properties means, for tools that show descriptions and units from them."""

from __future__ import annotations

from pathlib import Path

from ..errors import BimVerifyError
from ..files import whole_file
from .pset_definitions import TEMPLATES, described


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
                file, pset_template=made, name=prop, description=described(kind, description), primary_measure_type=kind
            )
    with whole_file(path) as temporary:
        file.write(str(temporary))
    return len(TEMPLATES)
