"""The figure of three gaits: every fly walks, and the table holds what is drawn."""

from flyrl.report import walking_figures


def test_every_gait_carries_every_fly(monkeypatch):
    monkeypatch.setattr(walking_figures, "FLIES", 2)
    monkeypatch.setattr(walking_figures, "DURATION_S", 0.6)
    plot = walking_figures.gaits_plot()
    rows = list(plot.table[["gait", "episode"]].itertuples(index=False, name=None))
    assert rows == [(gait, fly) for gait in ("tripod", "tetrapod", "wave") for fly in range(2)]
    assert plot.table["speed_mm_s"].min() > 5.0  # a fly that is not driven stays where it is
    rasters = plot.figure.axes[:3]
    assert [axes.get_title(loc="left") for axes in rasters] == ["tripod", "tetrapod", "wave"]
    assert all(len(axes.collections) == 6 for axes in rasters)
