"""The report of a mock-up: each step as a picture, and the types."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from ..report.plain_page import Section, write_page
from .grammar import grammar_of
from .mockup import Mockup, size_sigma
from .records import Facade

LARGEST_PX = 900
COLORS = (
    (214, 69, 65),
    (52, 120, 190),
    (60, 160, 90),
    (220, 150, 40),
    (140, 90, 180),
    (20, 160, 170),
    (200, 80, 150),
    (120, 120, 60),
)
PLANT = (40, 200, 60)


def write_facade_report(folder: str | Path, made: Mockup) -> Path:
    """Write ``index.html`` into ``folder`` (made if missing) and return its path; BimVerifyError where that fails."""
    sections = []
    for number, facade in enumerate(made.facades, start=1):
        scale = facade.scale
        sections.append(Section(
            f"Facade {number}: profiles",
            f"{Path(facade.image).name}, rectified. At the borders: how much straight edges change the picture along the "
            f"other direction. The elements are {facade.arrangement_x} along x and {facade.arrangement_z} along z. "
            "Plants are marked green.", drawing=_image(profile_picture(facade)),
        ))  # fmt: skip
        sections.append(
            Section(
                f"Facade {number}: elements",
                "One colour a type; doors are thick, what plants hide and the pattern gives is dashed. Lines: floors. "
                f"The facade is {scale.width:.2f} m wide and {scale.height:.2f} m high (scale from {scale.source.lower()}, "
                f"one sigma {100 * scale.relative_sigma:.1f} %; height against width {100 * scale.aspect_sigma:.1f} %).",
                drawing=_image(box_picture(facade)),
            )
        )
        split = grammar_of(facade)
        sections.append(Section(
            f"Facade {number}: split grammar",
            f"Floors, tiles and what is in them, metres; ~ sizes share what is left. {split.notes()}",
            drawing=Markup('<pre style="white-space:pre-wrap">{}</pre>').format(split.text()),
        ))  # fmt: skip
        if facade.warnings:
            sections.append(Section(f"Facade {number}: to know", " ".join(facade.warnings)))
    boxes = [b for f in made.facades for b in f.boxes]
    rows = []
    for kind in sorted({b.type for b in boxes}):
        own = [b for b in boxes if b.type == kind]
        owner = next(f for f in made.facades if own[0] in f.boxes)
        size = [float(np.median([getattr(b, n) for b in own])) for n in ("width", "height")]
        rows.append((
            f"{kind + 1}", own[0].kind, "arched" if own[0].rise > 0 else "rectangular", str(len(own)),
            *(text for axis in (0, 1) for text in (f"{size[axis]:.2f}", f"{size_sigma(owner, size[axis], axis):.2f}")),
        ))  # fmt: skip
    sections.append(Section(
        "Types", "Sigma is that of a single element: 19 of 20 lie within 1.96 times it, most are far better.",
        columns=("Type", "Kind", "Shape", "Elements", "Width m", "Sigma m", "Height m", "Sigma m"), rows=rows,
        numeric=frozenset({0, 3, 4, 5, 6, 7}),
    ))  # fmt: skip
    names = ", ".join(Path(f.image).name for f in made.facades)
    return write_page(folder, "Facade mock-up", "bim_verify facade", summary(made), (("Photos", names),), sections)


def summary(made: Mockup) -> str:
    """One sentence."""
    boxes = [b for f in made.facades for b in f.boxes]
    doors = sum(b.kind == "door" for b in boxes)
    return (
        f"{_count(len(made.facades), 'facade')}, {_count(len(made.building.storeys), 'storey')}, "
        f"{_count(len(boxes) - doors, 'window')}, {_count(doors, 'door')} of {_count(len({b.type for b in boxes}), 'type')}."
    )


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def box_picture(facade: Facade) -> NDArray[np.uint8]:
    """(H, W, 3) RGB: the elements over the rectified facade."""
    import cv2

    out, (sx, sz) = facade.picture.copy(), facade.pixels_per_metre
    high = out.shape[0]
    for level in facade.levels[1:]:
        y = round(high - level * sz)
        cv2.line(out, (0, y), (out.shape[1], y), (255, 255, 255), 1)
    for box in facade.boxes:
        color = COLORS[box.type % len(COLORS)]
        ring = [(box.x0, box.z0), (box.x1, box.z0), (box.x1, box.z1), (box.x0, box.z1)]
        if box.rise > 0:
            from .mockup import arch_outline

            ring = [(box.x0 + x, box.z0 + z) for x, z in arch_outline(box.width, box.height, box.rise)]
        points = np.array([[x * sx, high - z * sz] for x, z in ring]).round().astype(np.int32)
        thick = 4 if box.kind == "door" else 2
        if box.inferred:
            for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
                for t in np.arange(0.0, 1.0, 0.1):
                    p, q = a + t * (b - a), a + (t + 0.05) * (b - a)
                    cv2.line(out, tuple(int(v) for v in p), tuple(int(v) for v in q), color, 3)
        else:
            cv2.polylines(out, [points], True, color, thick, cv2.LINE_AA)
    return out


def profile_picture(facade: Facade) -> NDArray[np.uint8]:
    """(H, W, 3) RGB: the gradient profiles and the plants over the rectified facade."""
    import cv2

    out = facade.picture.copy()
    high, wide = out.shape[:2]
    if facade.vegetation.any():
        out[facade.vegetation] = (0.5 * out[facade.vegetation] + 0.5 * np.array(PLANT)).astype(np.uint8)
    across = np.column_stack([np.arange(wide), high - 1 - 0.2 * high * facade.profile_x]).round().astype(np.int32)
    up = np.column_stack([0.2 * wide * facade.profile_z, np.arange(high)]).round().astype(np.int32)
    for line in (across, up):
        cv2.polylines(out, [line], False, (0, 0, 0), 4, cv2.LINE_AA)
        cv2.polylines(out, [line], False, (0, 230, 255), 2, cv2.LINE_AA)
    return out


def _image(picture: NDArray[np.uint8]) -> Markup:
    import cv2

    shrink = LARGEST_PX / max(picture.shape[:2])
    if shrink < 1:
        picture = np.asarray(cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    assert done
    text = base64.b64encode(data.tobytes()).decode("ascii")
    return Markup('<img alt="" src="data:image/jpeg;base64,{}">').format(text)


def facade_to_plain(facade: Facade) -> dict[str, Any]:
    """As plain values; metres, wall frame, and pixels of the image."""
    scale, split = facade.scale, grammar_of(facade)
    return {
        "image": facade.image,
        "corners_px": facade.corners.tolist(),
        "levels_m": list(facade.levels),
        "width_m": scale.width,
        "height_m": scale.height,
        "scale_source": scale.source,
        "scale_sigma": scale.relative_sigma,
        "aspect_sigma": scale.aspect_sigma,
        "corner_source": facade.corner_source,
        "arrangement_x": facade.arrangement_x,
        "arrangement_z": facade.arrangement_z,
        "grammar": split.text().splitlines(),
        "grammar_error_m": split.largest_error,
        "grammar_left_out": len(split.left_out),
        "warnings": facade.warnings,
        "picture_px": [facade.picture.shape[1], facade.picture.shape[0]],
        "elements": [
            {"kind": b.kind, "box_m": [b.x0, b.z0, b.x1, b.z1], "rise_m": b.rise, "type": b.type, "inferred": b.inferred}
            for b in facade.boxes
        ],
    }
