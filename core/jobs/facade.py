"""Photos of facades to the facades with their windows and doors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError
from ..facade.find_facade import find_corners
from ..facade.footprint import Footprint, read_footprint
from ..facade.mockup import Mockup, mockup
from ..facade.read_facade import read_picture
from ..facade.records import Facade
from ..imagery.read_image import eight_bits, opened_image
from ..progress import Progress

Array = NDArray[np.float64]
FOCAL_35MM_TAG, EXIF_TAG = 0xA405, 0x8769
FILM_MM = 36.0
BASE_GB, BYTES_A_PIXEL = 0.5, 10.0
"""What reading a photo takes: libraries and the rectified picture; and its pixels, up to three times (7.4 was measured)."""


@dataclass(frozen=True, kw_only=True)
class FacadeOptions:
    """Options of ``facade``. Lengths in metres."""

    corners: tuple[Array, ...] = ()
    """(4, 2) of each image's facade, pixels; empty: found by vanishing lines."""
    width: float | None = None
    height: float | None = None
    floor_height: float | None = None
    threads: int = 0
    """0: as many as the machine has."""
    memory_gb: float = 3.0
    """A photo that takes more is refused."""
    seed: int = 0


def facade_mockup(
    images: Sequence[str | Path], options: FacadeOptions, outline: str = "", crs: str = "", progress: Progress | None = None
) -> tuple[Mockup, tuple[str, ...]]:
    """The mock-up of facades on an outline (``footprint.read_footprint``; empty: one facade alone), and notes on it.

    Raises BimVerifyError when lengths contradict one another, or an image, its corners or the outline cannot be used.
    """
    if outline and options.width:
        raise BimVerifyError("The edges of --footprint give the widths of the facades; leave out --width, or the footprint.")
    if options.floor_height and (outline or options.width or options.height):
        raise BimVerifyError("--floor-height sets the scale where no length is known; leave it out, or the length.")
    if crs and not outline:
        raise BimVerifyError("--crs names the map of a footprint; give --footprint too, or leave it out.")
    if not outline and len(images) > 1:
        raise BimVerifyError("Several facades need the outline they stand on; give --footprint, a corner list or GeoJSON.")
    base: Footprint | None = read_footprint(outline, crs) if outline else None
    found = facade(images, options, progress, base.widths(len(images)) if base else ())
    return (mockup(found), ()) if base is None else (mockup(found, base.corners, base.place), base.notes)


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
    with limited_picture_threads(options.threads):
        for k, path in enumerate(images):
            progress.update(k / len(images), f"reading {Path(path).name}")
            out.append(read_facade(path, options, k, widths[k] if widths else None))
    return out


@contextmanager
def limited_picture_threads(wanted: int) -> Iterator[None]:
    """Picture kernels use at most ``wanted`` threads inside; 0 for all."""
    import cv2

    before = cv2.getNumThreads()
    if wanted:
        cv2.setNumThreads(min(wanted, before))
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def read_facade(path: str | Path, options: FacadeOptions, index: int = 0, width: float | None = None) -> Facade:
    """The facade of one image."""
    image, focal = read_color(path, options.memory_gb)
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


def read_color(path: str | Path, memory_gb: float = 3.0) -> tuple[NDArray[np.uint8], float | None]:
    """(H, W, 3) RGB, upright as viewers show it, and the focal length in pixels where the file states it.

    Raises BimVerifyError where it is no image, or takes more memory than it may.
    """
    from PIL import ImageOps

    source = Path(path)
    with opened_image(source) as image:
        need = BASE_GB + 1e-9 * BYTES_A_PIXEL * image.width * image.height
        if need > memory_gb:
            raise BimVerifyError(
                f"{source} has {image.width} x {image.height} pixels and may take {need:.1f} GB; give a larger "
                f"--memory-gb than {memory_gb:g}, or a smaller photo."
            )
        stated = image.getexif().get_ifd(EXIF_TAG).get(FOCAL_35MM_TAG)
        pixels = np.array(eight_bits(ImageOps.exif_transpose(image)).convert("RGB"), dtype=np.uint8)
    if not isinstance(stated, int | float) or not 5 < stated < 1000:
        return pixels, None
    return pixels, float(stated) / FILM_MM * max(pixels.shape[:2])
