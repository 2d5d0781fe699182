"""Bars that fill with red as muscles exert themselves.

After cortex, Simulated Muscles, R. McIntyre (2012-14).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from flyrl.simulation.worms import (
    BAR_EMPTY,
    BAR_FRAME,
    BAR_HEIGHT,
    BAR_RED,
    BAR_WIDTH,
)
from flyrl.validation import FloatArray

_MARGIN: Final = 16


def tension_bars(
    picture: NDArray[np.uint8],
    tensions: Sequence[float] | FloatArray,
    width: int = BAR_WIDTH,
    height: int = BAR_HEIGHT,
) -> NDArray[np.uint8]:
    """Draw a bar per muscle into the lower right corner of a picture, the first on top.

    A bar measures `width` x `height` px and fills from the left with red; a thin frame surrounds
    it.
    """
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    left = image.width - _MARGIN - width
    for place, tension in enumerate(tensions[::-1]):
        top = image.height - _MARGIN - height - place * (height + 6)
        right, bottom = left + width - 1, top + height - 1
        draw.rectangle((left - 2, top - 2, right + 2, bottom + 2), fill=BAR_FRAME)
        draw.rectangle((left, top, right, bottom), fill=BAR_EMPTY)
        filled = round(width * float(tension))
        if filled:
            draw.rectangle((left, top, left + filled - 1, bottom), fill=BAR_RED)
    return np.asarray(image)
