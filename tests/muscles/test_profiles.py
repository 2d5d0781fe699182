"""The profiles in assets/, and tools/draw_profiles.py that drew them."""

import shutil

import numpy as np
import pytest
from PIL import Image

from flyrl.muscles import MotorPool, Muscle
from flyrl.resources import assets_folder
from tools.draw_profiles import FEW_NEURONS, NEURONS, main, profiles

FOLDER = assets_folder() / "muscles"


def test_the_assets_are_what_the_script_draws(capsys):
    assert main(["--check"]) == 0
    assert not capsys.readouterr().out


def test_the_check_finds_changed_missing_and_foreign_images(tmp_path, capsys):
    folder = shutil.copytree(FOLDER, tmp_path / "muscles")
    with Image.open(folder / "late.png") as image:
        changed = image.copy()
    changed.putpixel((3, 0), (255, 255, 254))
    changed.save(folder / "late.png")
    (folder / "human.png").unlink()
    changed.save(folder / "mine.png")
    assert main(["--check", "--folder", str(folder)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.rpartition("/")[2] for line in lines] == ["human.png", "late.png", "mine.png"]


@pytest.mark.parametrize("name", profiles())
def test_a_profile_rests_at_0_and_is_read_as_it_was_drawn(name):
    pool = MotorPool.from_image(FOLDER / f"{name}.png")
    assert len(pool) == (FEW_NEURONS if name == "small" else NEURONS)
    assert Muscle(pool).tension(0) == 0
    np.testing.assert_allclose(pool.forces, 255 * profiles()[name], atol=0.5)


def test_human_like_pools_have_their_weak_neurons_first():
    """Half of them give less than a tenth of the force: (100^0.5 - 1) / (100 - 1) = 1 / 11."""
    human = Muscle(MotorPool.from_image(FOLDER / "human.png"))
    assert human.tension(150) == pytest.approx(1 / 11, abs=0.004)
    # of 15, the weaker 7: (100^(8/15) - 100^(1/15)) / (100^(16/15) - 100^(1/15)) = 0.0765
    small = Muscle(MotorPool.from_image(FOLDER / "small.png"))
    assert small.tension(7) == pytest.approx(0.0765, abs=0.004)
