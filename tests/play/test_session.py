"""The course of what is played: pace, keys, log."""

import dataclasses
import itertools

import pytest

from flyrl.bodies.worm import DEMONSTRATION
from flyrl.play.session import PAUSE, RECORD, RESET, SEED, SPEED, STEP, Pace, Session
from flyrl.play.worm import PlayedWorm
from tests.play.noted import Noted
from tests.play.toy import Toy

AT_FIRST = {
    "is_watched": False,
    "is_paused": False,
    "speed": 1.0,
    "seed": 0,
    "is_recording": False,
    "recording": "",
    "message": "",
}


@pytest.mark.parametrize(
    ("interval_s", "speed", "times", "steps"),
    [
        # what is left of a step is not lost: 0.4 and 0.7 ms are one step, and 0.1 ms are left
        (0.001, 1, [7.0, 7.016, 7.0164, 7.0171, 7.1171], [0, 16, 0, 1, 100]),
        # a long delay is not made up for
        (0.001, 1, [0.0, 5.0, 5.01], [0, 100, 10]),
        # a sixteenth of 0.16 s is one step
        (0.01, 1 / 16, [0.0, 0.08, 0.16, 0.48], [0, 0, 1, 2]),
        # a step longer than what is made up for comes about
        (0.5, 1, [0.0, 0.3, 0.6, 9.0], [0, 0, 1, 1]),
    ],
)
def test_as_many_steps_as_time_has_passed(interval_s, speed, times, steps):
    pace = Pace(interval_s)
    assert [pace.steps(now, speed) for now in times] == steps


def test_a_pause_counts_for_nothing():
    pace = Pace(0.001)
    pace.steps(0.0)
    pace.steps(0.0005)
    pace.pause()
    assert [pace.steps(now) for now in (0.02, 0.0206, 0.03)] == [0, 0, 10]


@pytest.fixture
def log():
    return []


@pytest.fixture
def worm(log, kept):
    return Session(PlayedWorm(dataclasses.replace(DEMONSTRATION, segments=4)), kept, log.append)


class Kept:
    """Keeps the pictures that a recorder is given."""

    def __init__(self):
        self.is_on, self.note, self.taken = False, "", []

    def start(self):
        self.is_on, self.note = True, "recording"

    def take(self, model, data, camera, number):
        self.taken += [round(float(data.qpos[0]), 3)] * number

    def stop(self):
        self.is_on, self.note = False, "written"


@pytest.fixture
def kept():
    return Kept()


@pytest.fixture
def toy(log, kept):
    session = Session(Toy(), kept, log.append)
    session.watch(True)
    session.change("speed", 1.0)
    return session


def run(session, duration_s, start_s):
    """Pictures of 20 ms."""
    for frame in range(round(duration_s / 0.02) + 1):
        session.advance(start_s + 0.02 * frame)


def drawn(session, what):
    return Noted(session).drawn(what, "Time")


def test_without_anybody_watching_nothing_happens(worm, log):
    worm.press("h")
    worm.press("space")
    run(worm, 0.1, start_s=0.0)
    assert log == [{"time_s": 0.0, **AT_FIRST, "n": 0, "tension": 0.0, "bend_deg": 0.0}]


def test_the_worm_bends_in_real_time_as_keys_say(worm, log):
    worm.watch(True)
    for _ in range(15):
        worm.press("h")
    run(worm, 0.4, start_s=50.0)
    assert worm.playable.time_s == pytest.approx(0.4)
    assert [entry["n"] for entry in log[1:17]] == list(range(0, 301, 20))
    assert {entry["time_s"] for entry in log[:17]} == {0.0}
    assert log[-1]["tension"] == 1.0
    assert log[-1]["bend_deg"] > 30
    assert all(entry["is_watched"] for entry in log[1:])


def test_a_line_of_the_log_says_something_new(toy, log):
    run(toy, 0.2, start_s=0.0)
    said = [{**entry, "time_s": None} for entry in log]
    assert len(said) > 4
    assert all(one != next_ for one, next_ in itertools.pairwise(said))


def test_a_key_that_means_nothing_does_nothing(toy, log):
    toy.press("x")
    assert log[-1]["hops"] == 0
    toy.press("h")
    assert log[-1]["hops"] == 1


def test_who_leaves_lets_the_worm_relax_and_wait(worm, log):
    worm.watch(True)
    for _ in range(15):
        worm.press("h")
    run(worm, 0.2, start_s=0.0)
    bend = log[-1]["bend_deg"]
    worm.watch(False)
    left = {"time_s": 0.2, **AT_FIRST, "n": 0, "tension": 0.0, "bend_deg": bend}
    assert log[-1] == left
    run(worm, 1.0, start_s=0.2)
    assert log[-1] == left
    # the time away does not count
    worm.watch(True)
    run(worm, 0.1, start_s=100.0)
    assert worm.playable.time_s == pytest.approx(0.3)
    assert log[-1]["bend_deg"] < bend


def test_time_stands_still_in_a_pause_but_for_single_steps(toy, log):
    run(toy, 0.1, start_s=0.0)
    toy.press("space")
    run(toy, 1.0, start_s=0.1)
    assert toy.playable.time_s == pytest.approx(0.1)
    assert log[-1]["is_paused"]
    for step in (1, 2):
        toy.change(STEP, True)
        assert toy.playable.time_s == pytest.approx(0.1 + step * 0.002)
    toy.change(PAUSE, True)
    run(toy, 0.1, start_s=9.0)
    assert toy.playable.time_s == pytest.approx(0.204)
    assert not log[-1]["is_paused"]


def test_a_single_step_pauses(toy):
    toy.press("enter")
    assert toy.is_paused
    assert toy.playable.time_s == pytest.approx(0.002)


def test_slow_motion(toy, log):
    toy.change(SPEED, "1/4")
    run(toy, 0.4, start_s=0.0)
    assert log[-1]["speed"] == 0.25
    assert log[-1]["x"] == pytest.approx(0.1)


def test_a_reset_has_the_seed_that_was_typed(toy, log):
    run(toy, 0.1, start_s=0.0)
    toy.change(SEED, 5)
    assert log[-1]["seed"] == 0
    toy.change(RESET, True)
    assert [log[-1][name] for name in ("time_s", "seed", "x")] == [0.0, 5, 0.0]


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("shape", "cube", "shape must be one of 'box', 'ball', got 'cube'"),
        (SEED, -1, "seed must be an integer from 0"),
        (SPEED, "7", "speed must be one of"),
    ],
)
def test_what_is_refused_is_told_until_something_is_accepted(toy, log, name, value, told):
    toy.change(name, value)
    assert log[-1]["message"].startswith(told)
    assert drawn(toy, "text")[-1][0].startswith(told)
    assert (log[-1]["shape"], log[-1]["speed"], log[-1]["seed"]) == ("box", 1.0, 0)
    toy.change("shape", "ball")
    assert log[-1]["message"] == ""
    assert not any(text.startswith(told) for (text,) in drawn(toy, "text"))


def test_a_click_on_the_ground_is_handed_on(toy, log):
    toy.point(1.5, -2.0)
    assert (log[-1]["target_x"], log[-1]["target_y"]) == (1.5, -2.0)


def test_the_first_section_controls_time(toy):
    run(toy, 0.6, start_s=0.0)
    panel = Noted(toy)
    assert panel.titles == ["Time", "Drive", "What it does"]
    assert drawn(toy, "text") == [["0.60 s   1.00 x real time"]]
    assert drawn(toy, "buttons") == [[{PAUSE: "Pause", STEP: "Step", RESET: "Reset"}]]
    assert [drawn(toy, kind)[0][-1] for kind in ("choice", "integer", "switch")] == ["1", 0, False]
    toy.press("space")
    assert drawn(toy, "text") == [["0.60 s   paused"]]
    assert drawn(toy, "buttons")[0][0][PAUSE] == "Go on"


def test_a_slow_simulation_leaves_time_for_the_page(log, kept):
    # every look at the clock finds 20 ms gone
    ticks = itertools.count(0.0, 0.02)
    session = Session(Toy(), kept, log.append, clock=lambda: next(ticks))
    session.watch(True)
    session.advance(0.0)
    session.advance(0.1)
    # the 50 ms that it may take are over after 2 of the 10 bites of 10 ms
    assert session.playable.time_s == pytest.approx(0.02)


def test_a_video_has_25_pictures_per_second_of_the_screens_time(toy, kept, log):
    toy.change(SPEED, "1/2")
    toy.change(RECORD, True)
    assert log[-1]["is_recording"]
    run(toy, 0.4, start_s=0.0)
    # the first at once; one every 40 ms, in which half of that passes
    assert kept.taken == pytest.approx([0.0, *(0.02 * n for n in range(1, 11))], abs=0.011)
    toy.press("space")
    run(toy, 1.0, start_s=0.4)
    assert len(kept.taken) == 11
    toy.press("enter")
    assert len(kept.taken) == 12
    toy.change(RECORD, False)
    assert (log[-1]["is_recording"], log[-1]["recording"]) == (False, "written")


def test_who_leaves_ends_the_video(toy, kept):
    toy.change(RECORD, True)
    toy.watch(False)
    assert kept.note == "written"
