import mujoco
import numpy as np
import pandas as pd

from flyrl.cli.figures import FIGURES
from flyrl.cli.main import main
from flyrl.report.gallery import GALLERY


def test_every_figure_is_told_of():
    assert list(FIGURES) == list(GALLERY)


def test_a_figure_comes_with_the_numbers_that_it_shows(tmp_path, capsys):
    assert main(["figures", "muscle", "--output", str(tmp_path / "new")]) == 0
    assert capsys.readouterr().out == f"figures: {tmp_path / 'new'}\n"
    table = pd.read_csv(tmp_path / "new" / "muscle.csv")
    assert list(table) == ["n", "force", "tension"]
    # as many neurons as the image has pixels, weak ones first
    assert len(table) == 301
    assert table["tension"].iloc[-1] == 1.0
    np.testing.assert_allclose(
        table["tension"], np.cumsum(table["force"]) / table["force"].sum(), atol=1e-5
    )
    assert (tmp_path / "new" / "muscle.png").read_bytes().startswith(b"\x89PNG")
    svg = (tmp_path / "new" / "muscle.svg").read_text()
    assert svg.startswith("<?xml")
    assert "human.png" in svg


def test_no_such_figure(tmp_path, capsys):
    assert main(["figures", "mussle", "--output", str(tmp_path / "new")]) == 2
    assert "'muscle'" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_without_gl_the_others_are_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.delattr(mujoco, "GLContext", raising=False)  # as MUJOCO_GL=disable leaves it
    assert main(["figures", "worm", "muscle", "terrains", "--output", str(tmp_path)]) == 1
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "left out" in line]
    assert line.startswith("left out: worm, terrains: no GL library can draw here (MUJOCO_GL")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"muscle.csv", "muscle.png", "muscle.svg"}
