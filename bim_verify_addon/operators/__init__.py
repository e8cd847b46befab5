"""One file an operator; ``CLASSES`` is what is registered."""

from .align import BIMVERIFY_OT_align
from .change import BIMVERIFY_OT_change
from .export_ifc import BIMVERIFY_OT_export_ifc
from .import_ifc import BIMVERIFY_OT_import_ifc
from .import_scan import BIMVERIFY_OT_import_scan, BIMVERIFY_OT_remove_scan
from .select_findings import BIMVERIFY_OT_select_findings
from .show_results import BIMVERIFY_OT_show_results
from .verify import BIMVERIFY_OT_verify

CLASSES = (
    BIMVERIFY_OT_import_ifc,
    BIMVERIFY_OT_import_scan,
    BIMVERIFY_OT_remove_scan,
    BIMVERIFY_OT_align,
    BIMVERIFY_OT_verify,
    BIMVERIFY_OT_change,
    BIMVERIFY_OT_select_findings,
    BIMVERIFY_OT_show_results,
    BIMVERIFY_OT_export_ifc,
)
