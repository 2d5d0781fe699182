"""The figure of slopes: what a fly can walk up depends on how hard its feet hold on."""

import numpy as np

from flyrl.report import slopes_figure


def test_feet_that_hold_on_carry_the_fly_up_steeper_slopes(monkeypatch):
    monkeypatch.setattr(slopes_figure, "PUBLISHED", {0: 30, 20: 60})
    monkeypatch.setattr(slopes_figure, "STARTS", 2)
    monkeypatch.setattr(slopes_figure, "STEP_DEG", 15)
    (slippery, sticky) = slopes_figure.falling_slopes("hybrid")
    assert ((slippery >= 15) & (slippery <= 45)).all()
    assert (sticky > slippery).all()
    assert np.median(sticky) >= 60
