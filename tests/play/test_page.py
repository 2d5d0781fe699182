"""The page, in a browser with real keys and a real mouse, checked on the loop's own log."""

import io
import time

import mujoco
import numpy as np
import pytest
from PIL import Image

from flyrl.muscles import MotorPool
from flyrl.play.pointing import camera_view, ground_point
from flyrl.resources import assets_folder
from flyrl.simulation.worm_scenery import BAR_HEIGHT
from tests.chromium import chromium
from tests.play.commands import TOY, playing
from tests.play.toy import Toy

WIDTH, HEIGHT = 900, 440
"""px; of a page, in which the panel is unfolded and shows its first two sections."""

SCENE_HEIGHT = HEIGHT - 32
"""px; below is the viewer's own bar."""

LEFT = WIDTH - 342
"""px; where the panel begins."""

# Places on the page, as the panel is laid out.
PAUSE, STEP, RESET = ((LEFT + x, 100) for x in (28, 73, 117))
SEED_PLUS = (LEFT + 311, 152)
RECORD = (LEFT + 18, 178)
SLIDER_MIDDLE, SLIDER_RIGHT = (LEFT + 228, 234), (LEFT + 285, 234)
SHAPE = (LEFT + 200, 260)
SHAPES = {"box": (LEFT + 200, 285), "ball": (LEFT + 200, 305), "cube": (LEFT + 200, 325)}
GROUND = (140, 300)


def frames(page, number):
    """Wait for pictures of the page, of which there may be few in a second."""
    page.evaluate(
        """(number) => new Promise((resolve) => {
            const next = () => (number-- > 0 ? requestAnimationFrame(next) : resolve());
            next();
        })""",
        number,
    )


def click(page, place):
    """Click: the page reads the mouse once per picture."""
    page.mouse.move(*place)
    frames(page, 2)
    page.mouse.down()
    frames(page, 2)
    page.mouse.up()
    frames(page, 2)


def press(page, key, is_so, played):
    """Press a key until the log says what it did."""
    page.keyboard.down(key)
    entry = played.until(is_so)
    page.keyboard.up(key)
    frames(page, 2)  # the page reads keys once per picture
    return entry


def picture(page):
    shot = page.screenshot(timeout=120_000)
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def strong(colours, channel):
    """Where a channel stands out."""
    others = [other for other in range(3) if other != channel]
    return (colours[..., channel] > 90) & np.all(
        colours[..., channel, None] > colours[..., others] + 50, axis=-1
    )


def await_picture(page, shows):
    """Wait for a picture that shows something; a scene that has changed is not drawn at once."""
    end = time.monotonic() + 60
    while not shows(seen := picture(page)):
        assert time.monotonic() < end, "it is never seen"
    return seen


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def toy(tmp_path_factory, browser):
    """A toy in play, and its page."""
    with playing(tmp_path_factory.mktemp("toy") / "log.jsonl", TOY) as played:
        page = open_page(browser, played)
        yield played, page
        page.close()
        played.until(lambda entry: not entry["is_watched"])
        assert played.interrupt() == (0, "\n", "")


def open_page(browser, played):
    page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    page.goto(played.url)
    played.until(lambda entry: entry["is_watched"])
    # by then the panel has found its place
    await_picture(page, lambda seen: seen[:SCENE_HEIGHT, :LEFT].mean() > 100)
    frames(page, 4)
    return page


@pytest.mark.slow
class TestToy:
    """One page, in which one thing is done after the other."""

    def test_keys(self, toy):
        played, page = toy
        entry = press(page, "ArrowUp", lambda e: e["speed_x"] != 0, played)
        assert entry["speed_x"] == 0.5
        played.until(lambda entry: entry["x"] > 0.2)
        assert press(page, "h", lambda e: e["hops"] != 0, played)["hops"] == 1
        assert press(page, "ArrowDown", lambda e: e["speed_x"] != 0.5, played)["speed_x"] == 0

    def test_a_slider_is_dragged(self, toy):
        played, page = toy
        page.mouse.move(*SLIDER_MIDDLE)
        frames(page, 2)
        page.mouse.down()
        frames(page, 2)
        page.mouse.move(*SLIDER_RIGHT, steps=3)
        played.until(lambda entry: entry["speed_x"] > 0.9)
        frames(page, 2)
        page.mouse.up()
        frames(page, 3)
        # from -2 to 2 over 196 px, but for the grip's width
        expected = (SLIDER_RIGHT[0] - SLIDER_MIDDLE[0]) / 196 * 4
        assert played.entries()[-1]["speed_x"] == pytest.approx(expected, abs=0.2)

    def test_pause_step_reset(self, toy):
        played, page = toy
        click(page, PAUSE)
        paused = played.until(lambda entry: entry["is_paused"])
        click(page, STEP)
        step = played.until(lambda entry: entry["time_s"] != paused["time_s"] or len(entry) == 0)
        assert step["time_s"] >= paused["time_s"]
        click(page, SEED_PLUS)
        click(page, RESET)
        reset = played.until(lambda entry: entry["seed"] == 1)
        assert (reset["time_s"], reset["x"]) == (0, 0)
        press(page, "Space", lambda entry: not entry["is_paused"], played)

    def test_a_choice_changes_the_scene(self, toy):
        played, page = toy
        click(page, SHAPE)
        click(page, SHAPES["ball"])
        played.until(lambda entry: entry["shape"] == "ball")
        await_picture(page, lambda seen: strong(seen[:SCENE_HEIGHT, :LEFT], 1).sum() > 300)

    def test_what_is_refused_is_told(self, toy):
        played, page = toy
        click(page, SHAPE)
        click(page, SHAPES["cube"])
        entry = played.until(lambda entry: entry["message"])
        assert entry["message"] == "shape must be one of 'box', 'ball', got 'cube'"
        assert entry["shape"] == "ball"

    def test_a_click_on_the_ground_moves_the_target_there(self, toy):
        played, page = toy
        thing = Toy()
        mujoco.mj_forward(thing.model, thing.data)
        view = camera_view(thing.model, thing.data, thing.camera)
        x, y = GROUND
        place = ground_point(view, x / WIDTH, y / SCENE_HEIGHT, WIDTH / SCENE_HEIGHT)
        page.keyboard.down("Shift")
        click(page, GROUND)
        page.keyboard.up("Shift")
        entry = played.until(lambda entry: entry["target_x"] != 3)
        assert (entry["target_x"], entry["target_y"]) == pytest.approx(place, abs=0.02)

        def shows(seen):
            rows, columns = np.nonzero(strong(seen[:SCENE_HEIGHT, :LEFT], 2))
            return len(rows) and abs(columns.mean() - x) < 12 and abs(rows.mean() - y) < 12

        await_picture(page, shows)

    def test_a_video_is_recorded(self, toy):
        played, page = toy
        click(page, RECORD)
        on = played.until(lambda entry: entry["recording"])
        if not on["is_recording"]:
            pytest.skip(on["recording"])
        # the recorder's line has moved what is below, not the box
        click(page, RECORD)
        written = played.until(lambda entry: entry["recording"].startswith("Video: "))
        path = written["recording"].removeprefix("Video: ")
        assert path.endswith("toy_1.mp4")
        assert 1_000 < len(open(path, "rb").read()) < 2_000_000

    def test_a_page_that_closes_with_a_key_held_leaves_nothing_pressed(self, toy, browser):
        played, page = toy
        page.keyboard.down("ArrowUp")
        before = played.entries()[-1]["speed_x"]
        played.until(lambda entry: entry["speed_x"] == pytest.approx(before + 0.5, abs=0.02))
        page.close()
        left = played.until(lambda entry: not entry["is_watched"])
        assert left["speed_x"] == 0
        again = open_page(browser, played)
        assert played.entries()[-1]["speed_x"] == 0
        entry = press(again, "ArrowUp", lambda entry: entry["speed_x"] != 0, played)
        assert entry["speed_x"] == 0.5
        again.close()


def tension(n):
    pool = MotorPool.from_image(assets_folder() / "muscles" / "human.png")
    return pytest.approx(pool.recruitment[n], abs=5e-5)


def red_rows(seen):
    """In how many rows the panel shows the bar's red."""
    red, green, blue = np.moveaxis(seen[:, LEFT:], -1, 0)
    return np.any((red > 150) & (green < 60) & (blue < 60), axis=1).sum()


@pytest.mark.slow
def test_keys_recruit_neurons_and_the_worm_bends(tmp_path, browser):
    with playing(tmp_path / "log.jsonl") as played:
        page = open_page(browser, played)
        assert press(page, "h", lambda e: e["n"] == 20, played)["tension"] == tension(20)
        played.until(lambda entry: entry["bend_deg"] >= 0.4)
        assert press(page, "h", lambda e: e["n"] == 40, played)["tension"] == tension(40)
        await_picture(page, lambda seen: red_rows(seen) == BAR_HEIGHT)
        assert press(page, "n", lambda e: e["n"] == 20, played)["tension"] == tension(20)
        page.close()
        left = played.until(lambda entry: not entry["is_watched"])
        assert (left["n"], left["tension"]) == (0, 0)
        assert played.interrupt() == (0, "\n", "")
