"""Draw the profiles of motor pools in `assets/muscles/`.

    python tools/draw_profiles.py            # write assets/muscles/
    python tools/draw_profiles.py --check    # write nothing; fail if an image there would change

A profile is an image, a motor neuron per pixel of its first row: the neuron's force is 255 - blue,
so that white is weakest and dark red strongest (after cortex, Simulated Muscles, R. McIntyre).
Further rows are the same and only make it easier to look at. The first neuron of every profile has
no force: a muscle with it rests when it is activated with 0.
"""

from __future__ import annotations

import argparse
import io
import sys
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from flyrl.files import write_bytes  # noqa: E402

Array = NDArray[np.float64]

NEURONS: Final = 301
"""With the first, which has no force: 300 do."""

FEW_NEURONS: Final = 16
"""Of the pool "small", with the first: few enough that a policy can choose among them."""

HEIGHT: Final = 16
"""Pixels."""

WHITE: Final = np.array([255.0, 255.0, 255.0])
DARK_RED: Final = np.array([139.0, 0.0, 0.0])

FORCE_RANGE: Final = 100.0
"""How many times as strong as the first neuron a human-like pool's last one is.

Fuglevand, Winter and Patla (1993), doi:10.1152/jn.1993.70.6.2470, whose pools grow exponentially.
"""


def profiles() -> dict[str, Array]:
    """Force of every neuron within 0 and 1, by the name of the profile.

    (NEURONS,), and (FEW_NEURONS,) of "small", which is human-like too.
    """
    x = np.linspace(0.0, 1.0, NEURONS)
    shapes = {
        "linear": x,
        "human": _human(x),
        "uniform": np.ones(NEURONS),
        "late": np.clip((x - 0.6) / 0.4, 0.0, 1.0) ** 2,
        "two_humps": np.maximum(_hump(x, 0.28, 0.09), _hump(x, 0.78, 0.07)),
        "small": _human(np.linspace(0.0, 1.0, FEW_NEURONS)),
    }
    for forces in shapes.values():
        forces[0] = 0.0
    return shapes


def _human(x: Array) -> Array:
    forces: Array = FORCE_RANGE ** (x - 1.0)
    return forces


def _hump(x: Array, middle: float, width: float) -> Array:
    return np.exp(-0.5 * ((x - middle) / width) ** 2)


def draw(forces: Array) -> Image.Image:
    """Image of a profile, from white to dark red."""
    # rounded first, so that blue is exactly 255 - force
    share = np.round(255.0 * forces)[:, np.newaxis] / 255.0
    row = np.round(WHITE + share * (DARK_RED - WHITE)).astype(np.uint8)
    return Image.fromarray(np.broadcast_to(row, (HEIGHT, *row.shape)).copy())


def difference(images: dict[str, Image.Image], folder: Path) -> list[str]:
    """Return files of `folder` that hold other pixels, or are missing or too many.

    Pixels are compared, not bytes, since these differ among versions of zlib.
    """
    present = {path.name for path in folder.glob("*.png")}
    wrong = present ^ images.keys()
    for name in present & images.keys():
        with Image.open(folder / name) as image:
            as_drawn = (image.mode, image.size) == ("RGB", images[name].size)
            if not as_drawn or image.tobytes() != images[name].tobytes():
                wrong.add(name)
    return sorted(wrong)


def main(arguments: list[str] | None = None) -> int:
    """Draw, then write or compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--check", action="store_true", help="write nothing; report changes")
    parser.add_argument("--folder", type=Path, default=ROOT / "assets" / "muscles")
    options = parser.parse_args(arguments)
    images = {f"{name}.png": draw(forces) for name, forces in profiles().items()}
    if options.check:
        wrong = difference(images, options.folder)
        for name in wrong:
            print(f"differs: {options.folder / name}")
        return 1 if wrong else 0
    options.folder.mkdir(parents=True, exist_ok=True)
    for name, image in images.items():
        buffer = io.BytesIO()
        image.save(buffer, "PNG", optimize=True)
        write_bytes(options.folder / name, buffer.getvalue())
    return 0


if __name__ == "__main__":
    sys.exit(main())
