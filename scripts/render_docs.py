"""The picture of the README: the demo house, verified, beside the cut through its ground floor.

    python scripts/render_docs.py [--out docs/images]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from headless_entry import package

PACKAGE = package()

from PIL import Image, ImageDraw  # noqa: E402

from bim_verify.core.jobs import verify  # noqa: E402
from bim_verify.core.options import VerifyOptions  # noqa: E402
from bim_verify.core.report.camera import view_of_box  # noqa: E402
from bim_verify.core.report.palette import STATUS_COLORS, status_color  # noqa: E402
from bim_verify.core.report.render import render_view  # noqa: E402
from bim_verify.core.simulation.demo import make_demo  # noqa: E402

SIZE = (900, 640)
BACKGROUND = (250, 250, 247)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent.parent / "docs" / "images")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        files = make_demo(folder)
        result = verify(files.model, [files.scan], VerifyOptions(sample_spacing=0.05))
    model = result.model
    building = np.isin(model.triangle_element, [
        i for i, e in enumerate(model.elements) if e.ifc_class != "IfcGeographicElement"
    ])
    corner = model.vertices[model.triangles[building]].reshape(-1, 3)
    bounds = np.stack([corner.min(axis=0), corner.max(axis=0)])
    colors = status_color([v.status for v in result.verdicts])[model.triangle_element]
    outside = view_of_box(bounds, -52.0, 28.0, SIZE)
    inside = view_of_box(bounds, -52.0, 48.0, SIZE, cut_z=float(bounds[0, 2]) + 2.4)
    pictures = [
        np.asarray(render_view(model, camera, SIZE, face_colors=colors, background=(0.98, 0.98, 0.97)))
        for camera in (outside, inside)
    ]
    page = Image.new("RGB", (2 * SIZE[0], SIZE[1] + 60), BACKGROUND)
    for place, picture in enumerate(pictures):
        page.paste(Image.fromarray(picture[..., :3].astype(np.uint8)), (place * SIZE[0], 0))
    _legend(ImageDraw.Draw(page), result.summary(), SIZE[1] + 15)
    page.save(arguments.out / "demo.png", optimize=True)
    print(arguments.out / "demo.png")


def _legend(draw: ImageDraw.ImageDraw, summary: dict[str, object], top: int) -> None:
    left = 40
    for status, color in STATUS_COLORS.items():
        draw.rectangle((left, top, left + 28, top + 28), fill=tuple(round(255 * float(c)) for c in color))
        text = f"{status.lower()} {summary[status]}"
        draw.text((left + 40, top + 2), text, fill=(40, 40, 40), font_size=22)
        left += 340


if __name__ == "__main__":
    main()
