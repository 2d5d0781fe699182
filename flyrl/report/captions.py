"""Marks on pictures: names, the clock, a scale bar, what colours mean, bars of tension.

Titles stand in the upper left corner, the scale bar in the lower left. The lower right one is left
to the tension bars of worms, and in pictures of flies to the meaning of the legs' colours.
"""

from __future__ import annotations

import functools
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from flyrl.simulation.marks import LEG_COLOURS
from flyrl.simulation.rendering import Picture
from flyrl.validation import FloatArray

LENGTHS_MM: Final = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
"""Lengths of a scale bar."""

LONGEST: Final = 0.22
"""Largest share of a picture's width that a scale bar takes."""

MARGIN: Final = 10
"""Distance from the edges, px."""

_SHADE: Final = (10, 14, 20, 150)
_BRIGHT: Final = (255, 255, 255, 255)
_SOFT: Final = (205, 212, 220, 255)
_SMALL: Final = 12.0

_BAR_MARGIN: Final = 16
"""Distance of tension bars from the edges, px."""

_BAR_FRAME: Final = (40, 46, 54)
_BAR_EMPTY: Final = (236, 238, 241)
_BAR_RED: Final = (200, 24, 24)


def jpeg(picture: Picture) -> bytes:
    """A picture as a JPEG file."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=80)
    return buffer.getvalue()


@functools.cache
def font_of(size: float) -> ImageFont.FreeTypeFont:
    """The font of figures, which knows µ and the sign of times; Pillow's own does not."""
    return ImageFont.truetype(Path(mpl.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf"), size)


def clock_text(time_s: float, speed: float) -> str:
    """Simulated time, and how fast it plays; `speed` is simulated s per s of the video."""
    factor = "" if abs(speed - 1) < 1e-9 else f"{speed:g} \N{MULTIPLICATION SIGN} "
    return f"t = {time_s:.2f} s   {factor}real time"


def ending_text(outcome: str, time_s: float, longest_s: float) -> str:
    """Outcome and end of an episode, after the time of the last picture if that is earlier.

    Parameters
    ----------
    outcome
        Name of the outcome.
    time_s, longest_s
        When the episode ended, and up to when it is filmed at most, s.
    """
    text = f"{outcome.replace('_', ' ')} at {time_s:.2f} s"
    return text if time_s <= longest_s + 1e-9 else f"t = {longest_s:.2f} s; {text}"


def titled(picture: Picture, title: str, text: str = "", *, is_end: bool = False) -> Picture:
    """Write a title, and a line below it, which is brighter in the end."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    upper, lower = font_of(20.0), font_of(13.0)
    width = max(draw.textlength(title, upper), draw.textlength(text, lower))
    draw.rectangle((MARGIN, MARGIN, 34 + width, 68 if text else 46), fill=_SHADE)
    draw.text((22, 15), title, fill=_BRIGHT, font=upper)
    draw.text((22, 43), text, fill=_BRIGHT if is_end else _SOFT, font=lower)
    return np.asarray(image)


def scale_length(pixels_per_mm: float, width: int) -> tuple[float, int]:
    """Length of the scale bar of a picture `width` px wide, in mm and in px.

    It is the longest of `LENGTHS_MM` that fits; the shortest of them where none does.
    """
    fitting = [length for length in LENGTHS_MM if length * pixels_per_mm <= LONGEST * width]
    length = max(fitting, default=LENGTHS_MM[0])
    return length, round(length * pixels_per_mm)


def with_scale_bar(picture: Picture, pixels_per_mm: float, note: str = "") -> Picture:
    """Draw a scale bar into the lower left corner, with its length above it.

    Parameters
    ----------
    pixels_per_mm
        Scale of the picture, at the depth that the bar measures.
    note
        Stands beside the length.
    """
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    font = font_of(_SMALL)
    length, pixels = scale_length(pixels_per_mm, image.width)
    text = f"{length:g} mm{note}"
    width = max(pixels, round(draw.textlength(text, font)))
    left, bottom = MARGIN + 10, image.height - MARGIN - 9
    draw.rectangle((MARGIN, bottom - 32, left + width + 9, image.height - MARGIN - 1), fill=_SHADE)
    draw.text((left, bottom - 26), text, fill=_BRIGHT, font=font)
    draw.rectangle((left, bottom - 4, left + pixels - 1, bottom - 1), fill=_BRIGHT)
    return np.asarray(image)


def with_legend(picture: Picture, entries: Sequence[tuple[str, str]]) -> Picture:
    """Explain colours of legs in the lower right corner, one below the other.

    Parameters
    ----------
    entries
        Names in `LEG_COLOURS`, and what they mean.
    """
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    font = font_of(_SMALL)
    width = max(round(draw.textlength(text, font)) for _, text in entries)
    left, top = image.width - MARGIN - width - 38, image.height - MARGIN - 12 - 20 * len(entries)
    draw.rectangle((left, top, image.width - MARGIN - 1, image.height - MARGIN - 1), fill=_SHADE)
    for row, (name, text) in enumerate(entries):
        y = top + 7 + 20 * row
        colour = tuple(round(255 * part) for part in LEG_COLOURS[name])
        draw.rectangle((left + 10, y + 3, left + 21, y + 14), fill=colour)
        draw.text((left + 28, y), text, fill=_BRIGHT, font=font)
    return np.asarray(image)


def tension_bars(
    picture: Picture, tensions: Sequence[float] | FloatArray, width: int = 300, height: int = 20
) -> Picture:
    """Draw a bar per muscle into the lower right corner of a picture, the first on top.

    A bar measures `width` x `height` px and fills from the left with red; a thin frame surrounds
    it.
    """
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    left = image.width - _BAR_MARGIN - width
    for place, tension in enumerate(tensions[::-1]):
        top = image.height - _BAR_MARGIN - height - place * (height + 6)
        right, bottom = left + width - 1, top + height - 1
        draw.rectangle((left - 2, top - 2, right + 2, bottom + 2), fill=_BAR_FRAME)
        draw.rectangle((left, top, right, bottom), fill=_BAR_EMPTY)
        filled = round(width * float(tension))
        if filled:
            draw.rectangle((left, top, left + filled - 1, bottom), fill=_BAR_RED)
    return np.asarray(image)
