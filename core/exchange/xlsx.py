"""The table of all elements as an Excel workbook: one sheet of elements, one of counts with what each verdict means."""

from __future__ import annotations

import math
from pathlib import Path

from ..files import whole_file
from ..report.csv_out import HEADER, elements_rows
from ..report.palette import STATUS_HEX, STATUS_LABELS, STATUS_MEANINGS
from ..results import STATUSES, VerificationResult
from .findings import plain_text

LONGEST_CELL = 32_767
"""Characters that Excel keeps in one cell."""
DARK = ("CONFIRMED", "ABSENT")
"""Whose colour needs white text."""
WIDTHS = {"GlobalId": 25, "Name": 30, "Reason": 90, "Stations": 25, "Class": 20, "Storey": 18, "Status": 15}


def write_xlsx(path: str | Path, result: VerificationResult) -> None:
    """Write the workbook; lengths in millimetres, shares as percentages. Texts are never taken for formulas or links."""
    import xlsxwriter

    with whole_file(path) as temporary:
        options = {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
        book = xlsxwriter.Workbook(str(temporary), options)
        bold = book.add_format({"bold": True, "text_wrap": True, "valign": "top", "bottom": 1})
        share, millimetre = book.add_format({"num_format": "0 %"}), book.add_format({"num_format": "0.0"})
        colored = {
            s: book.add_format({"bg_color": STATUS_HEX[s], "font_color": "#ffffff" if s in DARK else "#000000"})
            for s in STATUSES
        }
        sheet = book.add_worksheet("Elements")
        sheet.freeze_panes(1, 3)
        sheet.write_row(0, 0, HEADER, bold)
        for column, name in enumerate(HEADER):
            sheet.set_column(column, column, WIDTHS.get(name, 12))
        for line, row in enumerate(elements_rows(result), start=1):
            for column, (name, value) in enumerate(zip(HEADER, row, strict=True)):
                if value is None or (isinstance(value, float) and not math.isfinite(value)):
                    continue
                if isinstance(value, bool):
                    sheet.write_boolean(line, column, value)
                elif isinstance(value, str):
                    style = next((colored[s] for s in STATUSES if s == value and name in ("Status", "Decided")), None)
                    sheet.write_string(line, column, plain_text(value)[:LONGEST_CELL], style)
                else:
                    style = millimetre if name.endswith("_mm") else None if name.endswith(("Count", "_m2")) else share
                    sheet.write_number(line, column, value, style)
        sheet.autofilter(0, 0, max(len(result.verdicts), 1), len(HEADER) - 1)
        counts = book.add_worksheet("Counts")
        counts.set_column(0, 0, 18)
        counts.set_column(3, 3, 60)
        counts.write_row(0, 0, ("Verdict", "Computed", "With decisions", "Meaning"), bold)
        held = result.as_decided()
        for line, status in enumerate(STATUSES, start=1):
            counts.write_string(line, 0, STATUS_LABELS[status], colored[status])
            counts.write_number(line, 1, result.count(status))
            counts.write_number(line, 2, held.count(status))
            counts.write_string(line, 3, STATUS_MEANINGS[status])
        counts.write_string(7, 0, "Method")
        counts.write_string(7, 1, plain_text(result.method))
        book.close()


