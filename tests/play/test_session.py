"""The course of what is played: pace, keys, log."""

import dataclasses
import itertools

import pytest

from flyrl.bodies.worm import DEMONSTRATION
from flyrl.play import PlayedWorm, Session
from flyrl.play.session import Pace


def test_as_many_steps_as_time_has_passed():
    pace = Pace(0.001)
    times = [7.0, 7.016, 7.0164, 7.0171, 7.1171]
    # what is left of a step is not lost: 0.4 and 0.7 ms are one step, and 0.1 ms are left
    assert [pace.steps(now) for now in times] == [0, 16, 0, 1, 100]


def test_a_long_delay_is_not_made_up_for():
    pace = Pace(0.001)
    assert [pace.steps(now) for now in (0.0, 5.0, 5.01)] == [0, 100, 10]


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
def session(log):
    return Session(PlayedWorm(dataclasses.replace(DEMONSTRATION, segments=4)), log.append)


def run(session, duration_s, start_s):
    """Pictures of 20 ms."""
    for frame in range(round(duration_s / 0.02) + 1):
        session.advance(start_s + 0.02 * frame)


def test_without_anybody_watching_nothing_happens(session, log):
    session.press("h")
    run(session, 0.1, start_s=0.0)
    assert log == [{"time_s": 0.0, "is_watched": False, "n": 0, "tension": 0.0, "bend_deg": 0.0}]


def test_the_worm_bends_in_real_time_as_keys_say(session, log):
    session.watch(True)
    for _ in range(15):
        session.press("h")
    run(session, 0.4, start_s=50.0)
    assert session.playable.data.time == pytest.approx(0.4)
    assert [entry["n"] for entry in log[1:17]] == list(range(0, 301, 20))
    assert {entry["time_s"] for entry in log[:17]} == {0.0}
    assert log[-1]["tension"] == 1.0
    assert log[-1]["bend_deg"] > 30
    assert all(entry["is_watched"] for entry in log[1:])


def test_a_line_of_the_log_says_something_new(session, log):
    session.watch(True)
    session.press("h")
    run(session, 0.2, start_s=0.0)
    said = [{**entry, "time_s": None} for entry in log]
    assert len(said) > 4
    assert all(one != next_ for one, next_ in itertools.pairwise(said))


def test_a_key_that_means_nothing_does_nothing(session, log):
    session.watch(True)
    session.press("x")
    assert log[-1]["n"] == 0


def test_who_leaves_lets_the_worm_relax_and_wait(session, log):
    session.watch(True)
    for _ in range(15):
        session.press("h")
    run(session, 0.2, start_s=0.0)
    bend = log[-1]["bend_deg"]
    session.watch(False)
    left = {"time_s": 0.2, "is_watched": False, "n": 0, "tension": 0.0, "bend_deg": bend}
    assert log[-1] == left
    run(session, 1.0, start_s=0.2)
    assert log[-1] == left
    # the time away does not count
    session.watch(True)
    run(session, 0.1, start_s=100.0)
    assert session.playable.data.time == pytest.approx(0.3)
    assert log[-1]["bend_deg"] < bend
