"""Recruitment, step by step."""

import dataclasses

import numpy as np
import pytest

from flyrl.bodies.worm import DEMONSTRATION, build_worm
from flyrl.muscles import load_creature
from flyrl.muscles.attachment import recruit_stepwise

WORM = dataclasses.replace(DEMONSTRATION, segments=4)


def moments(config=WORM, **settings):
    return list(recruit_stepwise(load_creature(build_worm(config)), **settings))


@pytest.fixture(scope="module")
def ramp():
    """Every 50 neurons, long enough for a short worm to settle."""
    return [moment for moment in moments(step=50, hold_s=0.4) if moment.is_last]


def test_neurons_are_recruited_step_by_step_to_the_last():
    told = [moment.n for moment in moments(step=70, hold_s=0.004, frame_s=0.002)]
    assert told == [0, 0, 70, 70, 140, 140, 210, 210, 280, 280, 300, 300]


def test_bend_and_tension_grow_non_linearly(ramp):
    """The pool is human-like: its second half gives ten elevenths of the force."""
    bends, tensions = np.transpose([(moment.bend, moment.tension[0]) for moment in ramp])
    assert tensions[0] == bends[0] == 0
    assert tensions[-1] == 1
    assert (np.diff(bends) > 0).all()
    assert bends[-1] > 0.5
    assert ramp[6].n == 2 * ramp[3].n == 300
    assert tensions[6] > 5 * tensions[3]
    assert bends[6] > 5 * bends[3]


@pytest.mark.parametrize("settings", [{"step": 0}, {"hold_s": 0.0}, {"frame_s": -1.0}])
def test_bad_settings(settings):
    (name,) = settings
    with pytest.raises(ValueError, match=name):
        moments(**settings)
