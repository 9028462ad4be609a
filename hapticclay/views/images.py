"""Images from disk, for clay that is drawn."""

from __future__ import annotations

import math
import os
import warnings

import numpy as np

from ..arguments import checked
from ..display import one_line
from ..errors import ParameterError
from ..files import read_bytes

MOST_VALUES = 5 * 10**7  # pixels times colors
LUMA = (0.299, 0.587, 0.114)  # brightness of red, green and blue (ITU-R BT.601)


@checked
def gray_image(path: str | os.PathLike[str]) -> np.ndarray:
    """Reads the brightness of an image, as `Grid.of_image` takes it.

    Args:
        path: of the file, PNG or any other format that Pillow reads; transparency is ignored.

    Returns:
        0 (black) to 1 (white), shape (rows, columns), from the top row down.

    Raises:
        ParameterError: there is no such image.
    """
    import imageio.v3 as iio

    try:
        content = read_bytes(path)
        with warnings.catch_warnings(action="ignore"):  # of large images, by Pillow
            size = math.prod(iio.improps(content, plugin="pillow").shape)
        if size > MOST_VALUES:
            raise ValueError(f"it has {size:.3g} values, more than {MOST_VALUES:.3g}")
        image = np.asarray(iio.imread(content, plugin="pillow"))
    except Exception as error:  # Pillow raises errors of many kinds for a damaged file
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        cause = one_line(reason, 200) or type(error).__name__
        raise ParameterError("image", str(path), f"must be an image file ({cause})") from None
    if image.dtype.kind not in "ub" or image.ndim not in (2, 3):
        raise ParameterError("image", str(path), "must hold pixels of whole numbers")
    gray = image.astype(float) / (np.iinfo(image.dtype).max if image.dtype.kind == "u" else 1.0)
    if gray.ndim == 3:
        gray = gray[..., :3] @ np.array(LUMA) if gray.shape[2] >= 3 else gray[..., 0]
    return np.clip(gray, 0.0, 1.0)
