"""The page, in a browser with real keys."""

import io
import time

import mujoco
import numpy as np
import pytest
from PIL import Image

from flyrl.muscles import MotorPool
from flyrl.play import PlayedWorm
from flyrl.play.page import display_model
from flyrl.resources import assets_folder
from flyrl.simulation.worm_scenery import BAR_HEIGHT, BAR_WIDTH
from tests.chromium import chromium
from tests.play.commands import playing

SIZE = {"width": 800, "height": 400}
PANEL_WIDTH = BAR_WIDTH + 30


def tension(n):
    pool = MotorPool.from_image(assets_folder() / "muscles" / "human.png")
    return pytest.approx(pool.recruitment[n], abs=5e-5)


def frames(page, number):
    """Wait for pictures of the page, of which there may be few in a second."""
    page.evaluate(
        """(number) => new Promise((resolve) => {
            const next = () => (number-- > 0 ? requestAnimationFrame(next) : resolve());
            next();
        })""",
        number,
    )


def press(page, key, is_so, played):
    """Press a key until the log says what it did."""
    page.keyboard.down(key)
    entry = played.until(is_so)
    page.keyboard.up(key)
    frames(page, 2)  # the page reads keys once per picture
    return entry


def red_rows(page):
    """In how many rows the panel's part of the picture, at the right, shows the bar's red."""
    picture = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(picture[:, -PANEL_WIDTH:], -1, 0)
    return np.any((red > 150) & (green < 60) & (blue < 60), axis=1).sum()


def await_bar(page):
    end = time.monotonic() + 30
    while (rows := red_rows(page)) != BAR_HEIGHT:
        assert time.monotonic() < end, f"{rows} rows of the picture are red"


@pytest.mark.slow
def test_keys_recruit_neurons_and_the_worm_bends(tmp_path):
    with chromium() as browser, playing(tmp_path / "log.jsonl") as played:
        assert played.entries() == [
            {"time_s": 0.0, "is_watched": False, "n": 0, "tension": 0.0, "bend_deg": 0.0}
        ]
        page = browser.new_page(viewport=SIZE)
        page.goto(played.url)
        played.until(lambda entry: entry["is_watched"])
        assert press(page, "h", lambda e: e["n"] == 20, played)["tension"] == tension(20)
        played.until(lambda entry: entry["bend_deg"] >= 0.4)
        assert press(page, "h", lambda e: e["n"] == 40, played)["tension"] == tension(40)
        played.until(lambda entry: entry["bend_deg"] >= 1.0)
        await_bar(page)
        assert press(page, "n", lambda e: e["n"] == 20, played)["tension"] == tension(20)
        played.until(lambda entry: entry["bend_deg"] <= 0.5)

        # a page that closes with a key held leaves nothing pressed
        page.keyboard.down("h")
        played.until(lambda entry: entry["n"] == 40)
        page.close()
        left = played.until(lambda entry: not entry["is_watched"])
        assert (left["n"], left["tension"]) == (0, 0)
        again = browser.new_page(viewport=SIZE)
        again.goto(played.url)
        played.until(lambda entry: entry["time_s"] > left["time_s"])
        entries = played.entries()
        assert entries[entries.index(left) + 1] == {**left, "is_watched": True}
        frames(again, 4)
        assert played.entries()[-1]["n"] == 0
        browser.close()
        played.until(lambda entry: not entry["is_watched"])
        steps = [entry["n"] for entry in played.entries()]
        changes = [n for n, before in zip(steps, [None, *steps[:-1]], strict=True) if n != before]
        assert changes == [0, 20, 40, 20, 40, 0]
        assert played.interrupt() == (0, "\n", "")


def test_what_is_drawn_knows_no_forces():
    worm = PlayedWorm()
    forces, constraints = [], []
    for model in (worm.model, display_model(worm.model)):
        data = mujoco.MjData(model)
        data.ctrl[:], data.qpos[:] = 100.0, 2.0  # beyond the joints' limits
        mujoco.mj_forward(model, data)
        forces.append(np.abs(data.qfrc_actuator).max())
        constraints.append(data.nefc)
    assert forces == [pytest.approx(100), 0]
    assert constraints == [worm.model.njnt, 0]
