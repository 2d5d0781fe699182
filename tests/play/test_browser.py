"""The page, in a browser with real keys and a real mouse, checked on the loop's own log."""

import io
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flyrl.cli.main import main
from tests.chromium import chromium
from tests.play.commands import FLY, TOY, playing

WIDTH, HEIGHT = 900, 500
"""px; of a page, in which the panel shows its first sections."""

SCALE = 0.2
"""Of the pixels that are drawn, since software takes its time for each; those of 5 px still show
bars and the target."""

SLOW_DISPLAY = """
    const draw = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = (next) => setTimeout(() => draw(next), 100);
"""
"""At most nine pictures a second: software draws each, on a whole core if nothing stops it."""

SCENE_HEIGHT = HEIGHT - 32
"""px; below is the viewer's own bar."""

LEFT, RIGHT = 12, 342
"""px; where the panel begins and ends."""

# Places on the page, as the panel is laid out.
PAUSE, STEP, RESET = ((LEFT + x, 119) for x in (28, 64, 99))
SEED_PLUS = (LEFT + 307, 170)
RECORD = (LEFT + 18, 196)
SLIDER_MIDDLE, SLIDER_RIGHT = (LEFT + 224, 250), (LEFT + 289, 250)
SHAPE = (LEFT + 200, 275)
SHAPES = {"ball": (LEFT + 200, 320), "cube": (LEFT + 200, 340)}
GROUND = (640, 300)


def frames(page, number):
    """Wait for pictures of the page, of which there may be few in a second."""
    page.evaluate(
        """(number) => new Promise((resolve) => {
            const next = () => (number-- > 0 ? requestAnimationFrame(next) : resolve());
            next();
        })""",
        number,
    )


def hover(page, place):
    """Move the mouse somewhere, until the page knows whether that is the panel or the scene."""
    page.mouse.move(*place)
    frames(page, 5)


def click(page, place):
    """Click: the page reads the mouse once per picture."""
    hover(page, place)
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


def drag(page, start, end, is_so, played):
    """Drag the mouse until the log says what it did."""
    hover(page, start)
    page.mouse.down()
    frames(page, 2)
    page.mouse.move(*end, steps=3)
    played.until(is_so)
    frames(page, 2)
    page.mouse.up()
    frames(page, 3)


def point_at(page, place):
    """Click on the ground."""
    page.keyboard.down("Shift")
    click(page, place)
    page.keyboard.up("Shift")


def await_picture(page, shows):
    """Wait until panel and scene show something; what has changed is not drawn at once."""
    end = time.monotonic() + 90
    while True:
        shot = page.screenshot(timeout=120_000, scale="device")
        seen = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)
        seen = seen[: int(SCENE_HEIGHT * SCALE)]
        if shows(seen[:, : int(RIGHT * SCALE)], seen[:, int(RIGHT * SCALE) :]):
            return
        assert time.monotonic() < end, "it is never seen"


def strong(colours, channel):
    """Where a channel stands out."""
    others = np.delete(colours, channel, axis=-1)
    return (colours[..., channel] > 90) & (colours[..., channel] > others.max(axis=-1) + 50)


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
    size = {"width": WIDTH, "height": HEIGHT}
    page = browser.new_page(viewport=size, device_scale_factor=SCALE)
    page.add_init_script(SLOW_DISPLAY)
    page.goto(played.url)
    played.until(lambda entry: entry["is_watched"])
    return page


@pytest.mark.slow
class TestToy:
    """One page, in which one thing is done after the other."""

    def test_bars_are_red(self, toy):
        await_picture(toy[1], lambda panel, _: strong(panel, 0).any(axis=1).sum() >= 16 * SCALE)

    def test_keys(self, toy):
        played, page = toy
        entry = press(page, "ArrowUp", lambda e: e["speed_x"] != 0, played)
        assert entry["speed_x"] == 0.5
        played.until(lambda entry: entry["x"] > 0.2)
        assert press(page, "h", lambda e: e["hops"] != 0, played)["hops"] == 1
        assert press(page, "ArrowDown", lambda e: e["speed_x"] != 0.5, played)["speed_x"] == 0

    def test_a_slider_is_dragged(self, toy):
        played, page = toy
        drag(page, SLIDER_MIDDLE, SLIDER_RIGHT, lambda entry: entry["speed_x"] > 0.9, played)
        # from -2 to 2 over 172 px, but for the grip's width
        expected = (SLIDER_RIGHT[0] - SLIDER_MIDDLE[0]) / 156 * 4
        assert played.entries()[-1]["speed_x"] == pytest.approx(expected, abs=0.2)

    def test_pause_step_reset(self, toy):
        played, page = toy
        click(page, PAUSE)
        paused = played.until(lambda entry: entry["is_paused"])
        click(page, STEP)
        step = played.until(lambda entry: entry["x"] != paused["x"])
        assert step["time_s"] == pytest.approx(paused["time_s"] + 0.002)
        click(page, SEED_PLUS)
        click(page, RESET)
        reset = played.until(lambda entry: entry["seed"] == 1)
        assert (reset["time_s"], reset["x"]) == (0, 0)
        press(page, "Space", lambda entry: not entry["is_paused"], played)

    def test_a_choice_changes_the_scene_and_what_is_refused_is_told(self, toy):
        played, page = toy
        click(page, SHAPE)
        click(page, SHAPES["ball"])
        played.until(lambda entry: entry["shape"] == "ball")
        click(page, SHAPE)
        click(page, SHAPES["cube"])
        entry = played.until(lambda entry: entry["message"])
        assert entry["message"] == "shape must be one of 'box', 'ball', got 'cube'"
        assert entry["shape"] == "ball"

    def test_a_click_on_the_ground_moves_the_target_there(self, toy):
        played, page = toy
        point_at(page, GROUND)
        played.until(lambda entry: entry["target_x"] != 3)

        def shows(_, scene):
            green, blue = (strong(scene, channel) for channel in (1, 2))
            if not green.any() or not blue.any():
                return False  # the ball, which was a box, is not there yet
            place = np.mean(np.nonzero(blue), axis=1)[::-1] / SCALE + (RIGHT, 0)
            return np.abs(place - GROUND).max() < 12

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
        path = Path(written["recording"].removeprefix("Video: "))
        assert path.name == "toy_1.mp4"
        assert 1_000 < path.stat().st_size < 2_000_000

    def test_a_page_that_closes_with_a_key_held_leaves_nothing_pressed(self, toy, browser):
        played, page = toy
        page.keyboard.down("ArrowUp")
        played.until(lambda entry: entry["speed_x"] == 0.5)
        page.close()
        left = played.until(lambda entry: not entry["is_watched"])
        assert left["speed_x"] == 0
        again = open_page(browser, played)
        # what is pressed while a page is still loading counts as held from before
        await_picture(again, lambda _, scene: strong(scene, 2).any())
        frames(again, 5)
        assert played.entries()[-1]["speed_x"] == 0
        entry = press(again, "ArrowUp", lambda entry: entry["speed_x"] != 0, played)
        assert entry["speed_x"] == 0.5
        again.close()


# Of the fly's panel.
WHO_STEERS, TARGET_ANY = (LEFT + 200, 331), (LEFT + 200, 393)
DRIVE_LEFT = (LEFT + 180, 357)


def target_of(entry):
    return entry["target_x_mm"], entry["target_y_mm"]


@pytest.mark.slow
def test_a_fly_is_steered_by_keys_by_sliders_and_by_a_policy_to_where_one_clicks(tmp_path, browser):
    main(["compile"])  # else the page waits for its controller for a minute
    with playing(tmp_path / "log.jsonl", FLY) as played:
        page = open_page(browser, played)
        stood = played.latest()
        assert (stood["drive_left"], stood["drive_right"]) == (0, 0)
        entry = press(page, "ArrowUp", lambda e: e["drive_left"] > 0, played)
        assert (entry["drive_left"], entry["drive_right"]) == (0.1, 0.1)
        end = (DRIVE_LEFT[0] + 60, DRIVE_LEFT[1])
        drag(page, DRIVE_LEFT, end, lambda entry: entry["drive_left"] > 0.4, played)
        entry = played.latest()
        assert entry["drive_right"] == 0.1
        # a stronger left side turns it right
        heading = entry["heading_deg"]
        played.until(lambda entry: (entry["heading_deg"] - heading) % 360 > 180)
        click(page, WHO_STEERS)
        click(page, TARGET_ANY)
        played.until(lambda entry: entry["steering"] == "target-any")
        target = target_of(played.latest())
        point_at(page, GROUND)
        played.until(lambda entry: target_of(entry) != target)
        # the fly may be there before anybody looks: when it was moved, it was away
        moved = next(entry for entry in played.entries() if target_of(entry) != target)
        put = target_of(moved)
        assert np.hypot(moved["x_mm"] - put[0], moved["y_mm"] - put[1]) > 1
        arrived = played.until(lambda entry: target_of(entry) not in (target, put))
        assert (arrived["outcome"], arrived["steering"]) == ("running", "target-any")
        press(page, "ArrowDown", lambda entry: entry["steering"] == "by hand", played)
        page.close()
        left = played.until(lambda entry: not entry["is_watched"])
        assert (left["drive_left"], left["drive_right"], left["steering"]) == (0, 0, "by hand")
        assert played.interrupt() == (0, "\n", "")
