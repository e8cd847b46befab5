"""Files to results: what every face of the project calls. One module a job."""

from .change_detection import change
from .classify import classify
from .dimensions import dimensions
from .plan import plan
from .quality import quality
from .reconstruct import reconstruct
from .verification import align_scans, verify

__all__ = ["align_scans", "change", "classify", "dimensions", "plan", "quality", "reconstruct", "verify"]
