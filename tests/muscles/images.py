"""Images of motor pools, for tests."""

import numpy as np
from PIL import Image


def save_profile(path, forces):
    """Save an image whose first row holds `forces` (whole numbers of 0 to 255); below it is none.

    Red and green tell nothing.
    """
    row = np.full((len(forces), 3), 255, np.uint8)
    row[:, 0] = 30
    row[:, 2] = 255 - np.asarray(forces)
    Image.fromarray(np.stack([row, np.full_like(row, 255)])).save(path)
    return path
