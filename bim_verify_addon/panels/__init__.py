"""The sidebar of the 3D view, tab "BIM Verify"."""

from .element import BIMVERIFY_PT_element
from .result import BIMVERIFY_PT_result
from .steps import STEP_PANELS, BIMVERIFY_PT_steps, BIMVERIFY_UL_scans
from .survey import BIMVERIFY_PT_survey

CLASSES = (BIMVERIFY_UL_scans, BIMVERIFY_PT_steps, *STEP_PANELS, BIMVERIFY_PT_survey, BIMVERIFY_PT_result, BIMVERIFY_PT_element)
