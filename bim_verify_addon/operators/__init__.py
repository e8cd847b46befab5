"""One file an operator; ``CLASSES`` is what is registered."""

from .align import BIMVERIFY_OT_align
from .export_ifc import BIMVERIFY_OT_export_ifc
from .import_ifc import BIMVERIFY_OT_import_ifc
from .import_scan import BIMVERIFY_OT_import_scan, BIMVERIFY_OT_remove_scan
from .plan import BIMVERIFY_OT_plan
from .quality import BIMVERIFY_OT_quality
from .select_status import BIMVERIFY_OT_select_status
from .show_results import BIMVERIFY_OT_show_results
from .simulate import BIMVERIFY_OT_simulate
from .verify import BIMVERIFY_OT_verify

CLASSES = (
    BIMVERIFY_OT_import_ifc,
    BIMVERIFY_OT_import_scan,
    BIMVERIFY_OT_remove_scan,
    BIMVERIFY_OT_align,
    BIMVERIFY_OT_verify,
    BIMVERIFY_OT_quality,
    BIMVERIFY_OT_plan,
    BIMVERIFY_OT_simulate,
    BIMVERIFY_OT_select_status,
    BIMVERIFY_OT_show_results,
    BIMVERIFY_OT_export_ifc,
)
