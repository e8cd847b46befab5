"""What is stored in the .blend file: the settings of the scene, its scans, and the verdict on each element's object."""

from __future__ import annotations

import math

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..core.options import VerifyOptions
from ..core.results import LEVELS
from ..core.sensing.presets import PRESETS
from .capabilities import CAPABILITIES, MODES
from .shared_settings import LOA_ITEMS, KnownRegistration

DEFAULTS = VerifyOptions()
DEFAULT_DISPLAY_VERTICES = 1_000_000

ALIGN_ITEMS = [
    ("none", "None", "The scans are in the model's frame already; a shift stays visible as a deviation"),
    ("fine", "Fine", "From a rough pose (about 0.5 m, 5 degrees) to the best fit; elements that moved do not pull"),
    ("auto", "Auto", "Without a pose: found from the planes of scan and model, then refined"),
]
FUSION_ITEMS = [
    (
        "station",
        "Per station",
        "Returns of one station share its error, so they are discounted before stations are combined",
    ),
    ("dempster", "Dempster", "Dempster's rule over all returns"),
    ("yager", "Yager", "Conflict becomes unknown"),
    ("dubois-prade", "Dubois-Prade", "Conflict goes to the union of what is in conflict"),
]
PRESET_ITEMS = [
    ("derived", "Derived", "From the point spacing and the scanner's sigma"),
    *((name, name, "As published for such points, whatever the scanner") for name in sorted(PRESETS)),
]
SCAN_FRAME_ITEMS = [
    ("auto", "Detect", "Whichever of the two makes scan and model overlap"),
    ("model", "Model", "Scan coordinates are the model's own"),
    ("map", "Map", "Scan coordinates are those of the model's map conversion (eastings, northings)"),
]
COLOR_ITEMS = [(mode.identifier, mode.label, mode.description) for mode in MODES.values()]


def _recolor(settings: BimVerifySettings, context: bpy.types.Context) -> None:
    from .paint import recolor

    recolor(settings.id_data)


def _forget_hover(settings: BimVerifySettings, context: bpy.types.Context) -> None:
    from .hover import forget

    forget()


def _resize_points(settings: BimVerifySettings, context: bpy.types.Context) -> None:
    from .point_display import set_point_size

    set_point_size(settings.point_size_mm / 1000)


class BimVerifyScan(bpy.types.PropertyGroup):
    """One scan file of the campaign."""

    path: StringProperty(name="File", subtype="FILE_PATH", description="Scan file, read when it is verified")
    points: FloatProperty(name="Points", description="Points in the file")
    stations: IntProperty(name="Stations", description="Scanner positions in the file")
    use: BoolProperty(name="Use", default=True, description="Verify with this scan")
    dense: BoolProperty(
        name="Dense points of photos",
        description="Points of a dense match, made with the photogrammetric project among the scans: no rays, occupied only",
    )
    epoch: IntProperty(
        name="Epoch", default=1, min=1, soft_max=20, description="Scans with the same number were made in the same epoch"
    )


class BimVerifyCount(bpy.types.PropertyGroup):
    """How many elements are in this class of this colour mode."""

    mode: StringProperty()
    category: StringProperty()
    count: IntProperty()


class BimVerifyElement(bpy.types.PropertyGroup):
    """The verdict on one element; lengths in metres, not-a-number where nothing was measured."""

    ifc_class: StringProperty(name="Class")
    element_name: StringProperty(name="Name")
    storey: StringProperty(name="Storey")
    status: StringProperty(name="Status", description="Empty: not verified yet")
    required_loa: StringProperty(name="Required level")
    achieved_loa: StringProperty(name="Reached level")
    belief_occupied: FloatProperty(name="Belief occupied")
    belief_empty: FloatProperty(name="Belief empty")
    belief_unknown: FloatProperty(name="Belief unknown", default=1.0)
    conflict: FloatProperty(name="Conflict")
    coverage: FloatProperty(name="Coverage")
    confirmed_ratio: FloatVectorProperty(name="Confirmed at LOA10 ... LOA50", size=len(LEVELS))
    sample_count: IntProperty(name="Samples")
    observed_count: IntProperty(name="Observed samples")
    area: FloatProperty(name="Surface", unit="AREA")
    deviation_median: FloatProperty(name="Median deviation", default=math.nan)
    deviation_p95: FloatProperty(name="95 % deviation", default=math.nan)
    displacement: FloatProperty(name="Shift", default=math.nan)
    displacement_vector: FloatVectorProperty(name="Shift X, Y, Z", size=3, default=(math.nan, math.nan, math.nan))
    displacement_sigma: FloatProperty(name="Shift sigma", default=math.nan)
    significant: BoolProperty(name="Significant at 95 %")
    measurement_sigma: FloatProperty(name="Measurement sigma")
    registration_sigma: FloatProperty(name="Registration sigma")
    reason: StringProperty(name="Why")
    stations: StringProperty(name="Seen by")
    decided_status: StringProperty(name="Decided", description="What a person decided instead; empty: as computed")
    decision_reason: StringProperty(name="Reason")
    decided_by: StringProperty(name="Decided by")
    decided_on: StringProperty(name="Decided on")
    taken_back: BoolProperty(name="Taken back", description="A decision in the file no longer counts")


class BimVerifyEdit(bpy.types.PropertyGroup):
    """What a step found for the IFC file."""

    step: StringProperty(name="Step", description="The operator")
    key: StringProperty(name="Key", description="Names it in memory; undo brings an earlier one back")


class BimVerifySettings(KnownRegistration, bpy.types.PropertyGroup):
    """The settings of one scene, and what was done in it."""

    model_path: StringProperty(name="Model", subtype="FILE_PATH", description="The IFC file that is verified")
    model_summary: StringProperty()
    scans: CollectionProperty(type=BimVerifyScan)
    scan_index: IntProperty(name="Scan")
    loa: EnumProperty(
        name="Level",
        items=LOA_ITEMS,
        default=str(DEFAULTS.loa),
        description="Level of accuracy that the building must reach",
    )
    sigma_mm: FloatProperty(
        name="Scanner sigma (mm)",
        default=DEFAULTS.sigma * 1000,
        min=0.01,
        soft_max=50,
        precision=2,
        description="Standard deviation of one return along its ray, millimetres (data sheet of the scanner)",
    )
    align: EnumProperty(
        name="Alignment", items=ALIGN_ITEMS, default=DEFAULTS.align, description="How scans are moved onto the model"
    )
    spacing_mm: FloatProperty(
        name="Sample spacing (mm)",
        default=DEFAULTS.sample_spacing * 1000,
        min=2,
        soft_max=200,
        precision=1,
        description="Distance between the places on the planned surface at which the scans are asked, millimetres",
    )
    fusion: EnumProperty(name="Fusion", items=FUSION_ITEMS, default=DEFAULTS.fusion, description="How evidence is combined")
    preset: EnumProperty(
        name="Parameters", items=PRESET_ITEMS, default=DEFAULTS.preset, description="Parameters of the belief masses"
    )
    scan_frame: EnumProperty(
        name="Scan frame",
        items=SCAN_FRAME_ITEMS,
        default=DEFAULTS.scan_frame,
        description="The frame of the scan coordinates",
    )
    origin: StringProperty(
        name="Scanner position",
        description="X,Y,Z in metres, for a scan file that does not say where the scanner stood; for several such files "
        "FILE=X,Y,Z; FILE=X,Y,Z; empty: not known",
    )
    threads: IntProperty(name="Threads", default=DEFAULTS.threads, min=0, max=256, description="0: as many as the machine has")
    memory_gb: FloatProperty(
        name="Memory (GB)",
        default=DEFAULTS.memory_gb,
        min=0.5,
        soft_max=64,
        description="Upper bound for the scans in memory, gigabytes",
    )
    display_points: IntProperty(
        name="Points shown",
        default=1_000_000,
        min=1000,
        soft_max=20_000_000,
        description="A scan is shown thinned to this many points; verification always uses all",
    )
    display_vertices: IntProperty(
        name="Result vertices",
        default=DEFAULT_DISPLAY_VERTICES,
        min=10_000,
        soft_max=10_000_000,
        description="Most vertices that the coloured surfaces may have together",
    )
    color_mode: EnumProperty(
        name="Colour by",
        items=COLOR_ITEMS,
        default="STATUS",
        description="What the colours of the elements say",
        update=_recolor,
    )
    deviation_range_mm: FloatProperty(
        name="Range (mm)",
        default=20.0,
        min=0.1,
        soft_max=500,
        description="Deviation with full colour, millimetres",
        update=_recolor,
    )
    show_numbers: BoolProperty(
        name="Numbers", default=True, description="Write the numbers of the active element into the 3D view, and why"
    )
    show_hover: BoolProperty(
        name="Under mouse",
        default=True,
        description="Write what is known of the element and of the place under the mouse beside it",
        update=_forget_hover,
    )
    selected_only: BoolProperty(
        name="Selected elements only",
        default=False,
        description="Give verdicts to the selected elements only; the others keep what they have",
    )
    point_size_mm: FloatProperty(
        name="Point size (mm)",
        default=10.0,
        min=0.1,
        soft_max=100,
        description="Diameter at which points of the scans are drawn and rendered, millimetres",
        update=_resize_points,
    )
    show_legend: BoolProperty(name="Legend", default=True, description="Draw the meaning of the colours in the 3D view")
    counts: CollectionProperty(type=BimVerifyCount)
    has_findings: BoolProperty(description="Something is known of an element that colours can show")
    overruled: IntProperty(description="Number of verdicts that a person overruled")
    edits: CollectionProperty(type=BimVerifyEdit)
    result_key: StringProperty(description="Names the result in memory; undo brings an earlier one back")
    verified_model: StringProperty(description="SHA-256 of the model that the verdicts are on")
    edited_model: StringProperty(description="SHA-256 of the model that the edits are for")
    result_summary: StringProperty()
    result_note: StringProperty()
    alignment_summary: StringProperty()
    exported_path: StringProperty()


CLASSES = (BimVerifyScan, BimVerifyCount, BimVerifyElement, BimVerifyEdit, BimVerifySettings)
OWNERS = ((bpy.types.Scene, "settings"), (bpy.types.Object, "element"))
"""What carries the property groups of the capabilities, and under which field of ``Capability`` they stand."""


def register() -> None:
    """Add the settings to scenes and the verdict to objects, then those of each capability."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.bim_verify = PointerProperty(type=BimVerifySettings)
    bpy.types.Object.bim_verify = PointerProperty(type=BimVerifyElement)
    for capability in CAPABILITIES:
        for cls in capability.classes:
            bpy.utils.register_class(cls)
        for owner, field in OWNERS:
            if (group := getattr(capability, field)) is not None:
                bpy.utils.register_class(group)
                setattr(owner, f"bim_verify_{capability.name}", PointerProperty(type=group))


def unregister() -> None:
    """Take them away again."""
    for capability in reversed(CAPABILITIES):
        for owner, field in reversed(OWNERS):
            if (group := getattr(capability, field)) is not None:
                delattr(owner, f"bim_verify_{capability.name}")
                bpy.utils.unregister_class(group)
        for cls in reversed(capability.classes):
            bpy.utils.unregister_class(cls)
    del bpy.types.Object.bim_verify
    del bpy.types.Scene.bim_verify
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
