"""``bim-verify displacement --m3c2``: two clouds of one place, point by point."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from ..progress import Progress
from .checks import check_outputs, input_options
from .table import Outcome, Values

if TYPE_CHECKING:
    from ..jobs.cloud_comparison import CloudComparison

COLUMNS = (
    "x_m", "y_m", "z_m", "nx", "ny", "nz", "distance_mm", "level_of_detection_mm", "significant", "base_points", "later_points",
    "base_spread_mm", "later_spread_mm",
)


def compare(values: Values, progress: Progress) -> Outcome:
    """Run the comparison that the command's values ask for."""
    from ..files import whole_file
    from ..jobs.cloud_comparison import ComparisonOptions, compare_clouds
    from ..report.json_out import to_plain

    check_outputs([values["base"], values["later"]], [values[key] for key in ("out", "json") if values[key]])
    options = ComparisonOptions(registration_sigma=values["registration_sigma_mm"] / 1000, **input_options(values))
    result = compare_clouds([values["base"]], [values["later"]], options, progress)
    facts = result.summary()
    lines = [
        f"{facts['compared']:.0f} of {facts['core_points']:.0f} core points lie in both clouds "
        f"({result.points[0]:,} and {result.points[1]:,} points).",
        f"Distance within 1, 5, 10 mm: {facts['within_1_mm']:.0%}, {facts['within_5_mm']:.0%}, {facts['within_10_mm']:.0%}; "
        f"median {1000 * facts['median_distance']:+.2f} mm.",
        f"Level of detection at 95 %: {1000 * facts['mean_level']:.2f} mm (mean); {facts['significant']:.0%} of the distances "
        "are larger than their own.",
        f"Distances: {values['out']}",
    ]

    def write() -> None:
        with whole_file(values["out"]) as temporary:
            temporary.write_text(comparison_csv(result), encoding="ascii", newline="")

    data = to_plain({"summary": facts, "options": options, "timings": result.timings})
    return Outcome(lines, data, None, write)


def comparison_csv(result: CloudComparison) -> str:
    """One line a core point that lies in both clouds."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    found = result.found
    for k in (found.distance == found.distance).nonzero()[0]:
        writer.writerow([
            *(f"{v:.4f}" for v in result.core[k]), *(f"{v:.5f}" for v in result.normal[k]), f"{1000 * found.distance[k]:.3f}",
            f"{1000 * found.level[k]:.3f}", int(found.significant[k]), *(int(n) for n in found.count[k]),
            *(f"{1000 * v:.3f}" for v in found.spread[k]),
        ])
    return text.getvalue()
