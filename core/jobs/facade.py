"""Photos of facades to the facades with their windows and doors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..facade.find_facade import find_corners
from ..facade.read_facade import read_picture
from ..facade.records import Facade
from ..imagery.read_image import MOST_PIXELS
from ..progress import Progress

Array = NDArray[np.float64]
FOCAL_35MM_TAG, EXIF_TAG = 0xA405, 0x8769
FILM_MM = 36.0


@dataclass(frozen=True, kw_only=True)
class FacadeOptions:
    """Options of ``facade``. Lengths in metres."""

    corners: tuple[Array, ...] = ()
    """(4, 2) of each image's facade, pixels; empty: found by vanishing lines."""
    width: float | None = None
    height: float | None = None
    floor_height: float | None = None
    seed: int = 0


def facade(
    images: Sequence[str | Path],
    options: FacadeOptions | None = None,
    progress: Progress | None = None,
    widths: Sequence[float | None] = (),
) -> list[Facade]:
    """One facade an image; ``widths`` overrides the width of single ones. Nothing is written.

    Raises BimVerifyError when an image or its corners cannot be used.
    """
    options, progress = options or FacadeOptions(), progress or Progress()
    if options.corners and len(options.corners) != len(images):
        raise BimVerifyError(
            f"{len(images)} images need the corners of {len(images)} facades, not of {len(options.corners)}; give --corners "
            "one text for each image, in their order."
        )
    out = []
    for k, path in enumerate(images):
        progress.update(k / len(images), f"reading {Path(path).name}")
        out.append(read_facade(path, options, k, widths[k] if widths else None))
    return out


def read_facade(path: str | Path, options: FacadeOptions, index: int = 0, width: float | None = None) -> Facade:
    """The facade of one image."""
    image, focal = read_color(path)
    corners = options.corners[index] if options.corners else find_corners(image, str(path), options.seed)
    found = read_picture(
        image,
        str(path),
        corners,
        width=width or options.width,
        height=options.height,
        floor_height=options.floor_height,
        focal=focal,
        seed=options.seed,
        corner_source="GIVEN" if options.corners else "LINES",
    )
    if not options.corners:
        found.warnings.append(
            "The corners of the facade were found by its lines and may lie metres off; look at the report, and give --corners "
            "for measures that hold."
        )
    return found


def read_color(path: str | Path) -> tuple[NDArray[np.uint8], float | None]:
    """(H, W, 3) RGB, upright as viewers show it, and the focal length in pixels where the file states it."""
    from PIL import Image, ImageOps

    source = Path(path)
    try:
        with Image.open(source) as image:
            if image.width * image.height > MOST_PIXELS:
                raise BimVerifyError(f"{source} has {image.width} x {image.height} pixels; {MOST_PIXELS:,} is the most.")
            stated = image.getexif().get_ifd(EXIF_TAG).get(FOCAL_35MM_TAG)
            pixels = np.array(ImageOps.exif_transpose(image).convert("RGB"), dtype=np.uint8)
    except OSError as error:
        reason = error.strerror or "unknown format"
        raise BimVerifyError(f"Cannot read {source} as an image: {reason}. Check the file.") from error
    except (Image.DecompressionBombError, ValueError, SyntaxError) as error:
        raise BimVerifyError(f"Cannot read {source} as an image ({str(error)[:80]}). Export it again.") from error
    if not isinstance(stated, int | float) or not 5 < stated < 1000:
        return pixels, None
    return pixels, float(stated) / FILM_MM * max(pixels.shape[:2])
