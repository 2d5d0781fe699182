import re

import numpy as np
import pytest

from flyrl.report.ground import MAX_LEVELS, SHADES, ground_symbol, levels
from flyrl.terrains import Blocks, Bounds, Gapped, Mixed


def layers(config, view):
    """Opacity and path data of each level, the lowest first."""
    symbol = ground_symbol(config.compiled().boxes, view, "g")
    return re.findall(r'fill-opacity="([\d.]+)" d="([^"]*)"', symbol)


def test_gaps_are_bare():
    # Slabs of 1 mm start at -10 mm, with 0.3 mm between them; y points down, as SVG has it.
    ((_, slabs),) = layers(Gapped(), Bounds(-10, -7, 0, 5))
    assert slabs == "M-10 -5h1v5h-1zM-8.7 -5h1v5h-1zM-7.4 -5h0.4v5h-0.4z"


def test_high_blocks_are_laid_over_the_low_ground():
    # Blocks of 1.1 * 1.3 mm at a pitch of 1.3 mm; the first stands out, its neighbours do not.
    (_, low), (_, high) = layers(Blocks(), Bounds(-11, -8.8, -21, -18.8))
    corner = "M-10.065 18.8h1.265v1.265h-1.265z"
    assert (low, high) == (corner + corner, corner)  # the low ground goes on below the block
    (_, low), (_, high) = layers(Blocks(), Bounds(-8.6, -7.5, -20, -18.8))
    assert low == "M-8.6 18.8h1.1v1.2h-1.1z"
    assert high == ""  # between two high blocks there is a low one: 1.17 mm wide


def test_what_is_out_of_view_is_not_drawn():
    ((_, slabs),) = layers(Gapped(), Bounds(-8.9, -8.8, 0, 5))
    assert slabs == ""


def test_the_layers_of_the_highest_ground_come_to_its_shade():
    shades = [float(shade) for shade, _ in layers(Mixed(), Bounds(-4, 23, -5, 5))]
    assert shades[0] == SHADES[0]
    assert 1 - np.prod(1 - np.array(shades)) == pytest.approx(SHADES[1], abs=1e-3)


def test_a_few_heights_are_told_apart():
    np.testing.assert_array_equal(levels(np.array([0.45, 0.1, 0.1 + 1e-9, 0.45])), [0.1, 0.45])


def test_many_heights_are_put_together():
    heights = levels(np.linspace(0.0, 1.2, 100))
    assert MAX_LEVELS == 6
    np.testing.assert_allclose(heights, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
