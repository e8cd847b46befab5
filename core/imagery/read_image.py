"""Grey values of a photo as it lies on the sensor."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import BimVerifyError

T = TypeVar("T")
MOST_PIXELS = 170_000_000


def eight_bits(image: Any) -> Any:
    """The Pillow ``image`` with 8 bits a channel; 16 bits of grey, which its own conversion cuts off, are scaled."""
    from PIL import Image

    if not image.mode.startswith("I"):
        return image
    return Image.fromarray((np.asarray(image).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8))


@contextmanager
def opened_image(path: Path) -> Iterator[Any]:
    """The Pillow image in a file. Raises BimVerifyError where it is none, is damaged, or has more than ``MOST_PIXELS``."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(path)
        with image:
            if image.width * image.height > MOST_PIXELS:
                raise BimVerifyError(f"{path} has {image.width} x {image.height} pixels; {MOST_PIXELS:,} is the most.")
            yield image
    except Image.DecompressionBombError as error:
        raise BimVerifyError(f"{path} has more pixels than {MOST_PIXELS:,}, which is the most. Give a smaller one.") from error
    except OSError as error:
        reason = error.strerror or "unknown format"
        raise BimVerifyError(f"Cannot read {path} as an image: {reason}. Check the file.") from error
    except (ValueError, SyntaxError) as error:
        raise BimVerifyError(f"Cannot read {path} as an image ({str(error)[:80]}). Export it again.") from error


def check_image(path: str | Path, size: tuple[int, int]) -> None:
    """Raise BimVerifyError where a file is no image of the ``size`` (width, height); its pixels are not read."""
    _opened(path, size, lambda _: None)


def read_grey(path: str | Path, size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """(H, W) of a JPEG, PNG or TIFF file; not turned as its EXIF entry asks, since cameras are calibrated unturned.

    ``size`` (width, height) is what it must have. Raises BimVerifyError.
    """
    return _opened(path, size, lambda image: np.asarray(eight_bits(image).convert("L"), dtype=np.uint8))


def _opened(path: str | Path, size: tuple[int, int] | None, use: Callable[[Any], T]) -> T:
    with opened_image(Path(path)) as image:
        if size is not None and (image.width, image.height) != size:
            raise BimVerifyError(
                f"{path} has {image.width} x {image.height} pixels, its interior orientation is for "
                f"{size[0]} x {size[1]}; give the image as it was taken, or scale the interior orientation."
            )
        return use(image)
