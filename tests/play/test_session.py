"""The course of what is played: pace, keys, log."""

import itertools

import pytest

from flyrl.play.session import PAUSE, RECORD, RESET, SEED, SPEED, STEP, Session
from tests.play.noted import Noted, drawn
from tests.play.toy import Toy


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
def log():
    return []


@pytest.fixture
def kept():
    return Kept()


@pytest.fixture
def toy(log, kept):
    """A session of a toy that is watched, and drives at 1 per second."""
    session = Session(Toy(), kept, log.append)
    session.watch(True)
    session.change("speed", 1.0)
    return session


def run(session, duration_s, start_s):
    """Pictures of 20 ms."""
    for frame in range(round(duration_s / 0.02) + 1):
        session.advance(start_s + 0.02 * frame)


@pytest.mark.parametrize(
    ("interval_s", "speed", "times", "steps"),
    [
        # what is left of a step is not lost: 0.4 and 0.7 ms are one step, and 0.1 ms are left
        (0.001, "1", [7.0, 7.016, 7.0164, 7.0171, 7.1171], [0, 16, 0, 1, 100]),
        # a long delay is not made up for
        (0.001, "1", [0.0, 5.0, 5.01], [0, 100, 10]),
        # a sixteenth of 0.16 s is one step
        (0.01, "1/16", [0.0, 0.08, 0.16, 0.48], [0, 0, 1, 2]),
        # a step longer than what is made up for comes about
        (0.5, "1", [0.0, 0.3, 0.6, 9.0], [0, 0, 1, 1]),
    ],
)
def test_as_many_steps_as_time_has_passed(interval_s, speed, times, steps, kept):
    session = Session(Toy(interval_s), kept, lambda entry: None)
    session.watch(True)
    session.change(SPEED, speed)
    taken, before_s = [], 0.0
    for now_s in times:
        session.advance(now_s)
        taken.append(round((session.playable.time_s - before_s) / interval_s))
        before_s = session.playable.time_s
    assert taken == steps


def test_a_slow_simulation_leaves_time_for_the_page(kept):
    # every look at the clock finds 20 ms gone
    ticks = itertools.count(0.0, 0.02)
    session = Session(Toy(), kept, lambda entry: None, clock=lambda: next(ticks))
    session.watch(True)
    session.advance(0.0)
    session.advance(0.1)
    # the 50 ms that it may take are over after 2 of 50 steps
    assert session.playable.time_s == pytest.approx(0.004)


def test_without_anybody_watching_nothing_happens(log, kept):
    session = Session(Toy(), kept, log.append)
    for key in ("h", PAUSE):
        session.change(key, True)
    run(session, 0.1, start_s=0.0)
    (entry,) = log
    assert {name: entry[name] for name in ("time_s", "is_watched", "is_paused", "hops")} == {
        "time_s": 0.0, "is_watched": False, "is_paused": False, "hops": 0
    }  # fmt: skip
    assert list(entry)[:8] == [
        "time_s", "is_watched", "is_paused", "speed", "seed", "is_recording", "recording", "message"
    ]  # fmt: skip


def test_a_line_of_the_log_says_something_new(toy, log):
    toy.change("h", True)
    assert log[-1]["hops"] == 1
    run(toy, 0.2, start_s=0.0)
    said = [{**entry, "time_s": None} for entry in log]
    assert len(said) > 4
    assert all(one != next_ for one, next_ in itertools.pairwise(said))


def test_who_leaves_lets_go_stops_time_and_ends_the_video(toy, log, kept):
    toy.change(RECORD, True)
    run(toy, 0.2, start_s=0.0)
    toy.watch(False)
    left = log[-1]
    assert (left["time_s"], left["speed_x"], left["recording"]) == (0.2, 0.0, "written")
    run(toy, 1.0, start_s=0.2)
    assert log[-1] == left
    # the time away does not count
    toy.watch(True)
    run(toy, 0.1, start_s=100.0)
    assert toy.playable.time_s == pytest.approx(0.3)


def test_time_stands_still_in_a_pause_but_for_single_steps(toy, log):
    run(toy, 0.1, start_s=0.0)
    toy.change(PAUSE, True)
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
    # a single step pauses
    toy.change(STEP, True)
    assert log[-1]["is_paused"]


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
    ],
)
def test_what_is_refused_is_told_until_something_is_accepted(toy, log, name, value, told):
    toy.change(name, value)
    assert log[-1]["message"].startswith(told)
    assert drawn(toy, "text", "Time")[-1][0].startswith(told)
    assert (log[-1]["shape"], log[-1]["seed"]) == ("box", 0)
    toy.change("shape", "ball")
    assert log[-1]["message"] == ""
    assert len(drawn(toy, "text", "Time")) == 1


def test_the_first_section_controls_time(toy):
    run(toy, 0.6, start_s=0.0)
    assert Noted(toy).titles == ["", "Time", "Drive"]
    assert drawn(toy, "text") == [["0.60 s   1.00 x real time"]]
    assert drawn(toy, "buttons") == [[{PAUSE: "Pause", STEP: "Step", RESET: "Reset"}]]
    assert [drawn(toy, kind)[0][-1] for kind in ("choice", "integer", "switch")] == ["1", 0, False]
    toy.change(PAUSE, True)
    assert drawn(toy, "text") == [["0.60 s   paused"]]
    assert drawn(toy, "buttons")[0][0][PAUSE] == "Resume"


def test_a_video_has_25_pictures_per_second_of_the_screens_time(toy, kept, log):
    toy.change(SPEED, "1/2")
    toy.change(RECORD, True)
    assert (log[-1]["is_recording"], log[-1]["speed"]) == (True, 0.5)
    run(toy, 0.4, start_s=0.0)
    # the first at once; one every 40 ms, in which half of that passes
    assert kept.taken == pytest.approx([0.002, *(0.02 * n for n in range(1, 11))])
    toy.change(PAUSE, True)
    run(toy, 1.0, start_s=0.4)
    assert len(kept.taken) == 11
    toy.change(RECORD, False)
    assert (log[-1]["is_recording"], log[-1]["recording"]) == (False, "written")
