"""The figure of slopes: what a fly can walk up depends on how hard its feet hold on."""

import numpy as np

from flyrl.report import walking_figures


def test_feet_that_hold_on_carry_the_fly_up_steeper_slopes(monkeypatch):
    monkeypatch.setattr(walking_figures, "PUBLISHED", {0: 30, 20: 60})
    monkeypatch.setattr(walking_figures, "STARTS", 2)
    monkeypatch.setattr(walking_figures, "STEP_DEG", 15)
    (slippery, sticky) = walking_figures.falling_slopes("hybrid")
    assert ((slippery >= 15) & (slippery <= 45)).all()
    assert (sticky > slippery).all()
    assert np.median(sticky) >= 60
