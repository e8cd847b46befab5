"""One file an operator; ``CLASSES`` is what is registered."""

from .align import BIMVERIFY_OT_align
from .bundle import BIMVERIFY_OT_bundle
from .change import BIMVERIFY_OT_change
from .classify import BIMVERIFY_OT_classify
from .compare import BIMVERIFY_OT_compare
from .coregister import BIMVERIFY_OT_coregister
from .decide import BIMVERIFY_OT_decide
from .displacement import BIMVERIFY_OT_displacement
from .export_bcf import BIMVERIFY_OT_export_bcf
from .export_cameras import BIMVERIFY_OT_export_cameras
from .export_change import BIMVERIFY_OT_export_change
from .export_displacement import BIMVERIFY_OT_export_displacement
from .export_ifc import BIMVERIFY_OT_export_ifc
from .export_other import (
    BIMVERIFY_OT_export_dimensions,
    BIMVERIFY_OT_export_ids,
    BIMVERIFY_OT_export_table,
    BIMVERIFY_OT_export_templates,
    BIMVERIFY_OT_report,
)
from .export_survey import BIMVERIFY_OT_export_plan, BIMVERIFY_OT_export_quality
from .facade import BIMVERIFY_OT_facade, BIMVERIFY_OT_write_facade
from .import_ifc import BIMVERIFY_OT_import_ifc
from .import_scan import BIMVERIFY_OT_import_scan, BIMVERIFY_OT_remove_scan
from .look_through import BIMVERIFY_OT_look_through
from .plan import BIMVERIFY_OT_plan
from .quality import BIMVERIFY_OT_quality
from .reconstruct import BIMVERIFY_OT_reconstruct
from .reference_scans import BIMVERIFY_OT_add_reference, BIMVERIFY_OT_remove_reference
from .select_findings import BIMVERIFY_OT_select_findings
from .show_results import BIMVERIFY_OT_show_results
from .simulate import BIMVERIFY_OT_simulate
from .undo_update import BIMVERIFY_OT_undo_update
from .update_model import BIMVERIFY_OT_update_model
from .verify import BIMVERIFY_OT_verify
from .walk_findings import BIMVERIFY_OT_isolate_findings, BIMVERIFY_OT_step_finding

CLASSES = (
    BIMVERIFY_OT_import_ifc,
    BIMVERIFY_OT_import_scan,
    BIMVERIFY_OT_remove_scan,
    BIMVERIFY_OT_align,
    BIMVERIFY_OT_verify,
    BIMVERIFY_OT_change,
    BIMVERIFY_OT_add_reference,
    BIMVERIFY_OT_remove_reference,
    BIMVERIFY_OT_export_change,
    BIMVERIFY_OT_coregister,
    BIMVERIFY_OT_export_cameras,
    BIMVERIFY_OT_bundle,
    BIMVERIFY_OT_look_through,
    BIMVERIFY_OT_select_findings,
    BIMVERIFY_OT_step_finding,
    BIMVERIFY_OT_isolate_findings,
    BIMVERIFY_OT_quality,
    BIMVERIFY_OT_export_quality,
    BIMVERIFY_OT_plan,
    BIMVERIFY_OT_export_plan,
    BIMVERIFY_OT_simulate,
    BIMVERIFY_OT_reconstruct,
    BIMVERIFY_OT_compare,
    BIMVERIFY_OT_displacement,
    BIMVERIFY_OT_export_displacement,
    BIMVERIFY_OT_classify,
    BIMVERIFY_OT_facade,
    BIMVERIFY_OT_write_facade,
    BIMVERIFY_OT_show_results,
    BIMVERIFY_OT_decide,
    BIMVERIFY_OT_export_ifc,
    BIMVERIFY_OT_update_model,
    BIMVERIFY_OT_undo_update,
    BIMVERIFY_OT_export_bcf,
    BIMVERIFY_OT_report,
    BIMVERIFY_OT_export_table,
    BIMVERIFY_OT_export_dimensions,
    BIMVERIFY_OT_export_ids,
    BIMVERIFY_OT_export_templates,
)
