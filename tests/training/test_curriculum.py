import pytest

from flyrl.training.callback import Curriculum
from flyrl.training.config import CurriculumConfig

CONFIG = CurriculumConfig(enabled=True, start=0.2, step=0.3, window=4, raise_at=0.75, lower_at=0.25)


def _after(*successes, curriculum=None):
    curriculum = curriculum or Curriculum(CONFIG)
    for is_success in successes:
        curriculum.count(bool(is_success), curriculum.difficulty)
    return curriculum


def test_it_starts_low_and_waits_for_a_full_window():
    assert _after().difficulty == 0.2
    assert _after(1, 1, 1).difficulty == 0.2
    assert _after(1, 1, 0, 1).difficulty == 0.5


def test_the_latest_episodes_count():
    assert _after(0, 0, 1, 1, 0).difficulty == 0.2
    assert _after(0, 0, 1, 1, 0, 1).difficulty == 0.5


def test_a_change_begins_a_new_window():
    curriculum = _after(1, 1, 1, 1, 1, 1, 1)
    assert curriculum.difficulty == 0.5
    assert curriculum.success_rate == 1.0
    assert _after(1, curriculum=curriculum).success_rate is None


def test_it_ends_at_1():
    assert _after(*[1] * 12).difficulty == 1.0
    assert _after(*[1] * 40).difficulty == 1.0


def test_it_falls_back_but_not_below_the_start():
    curriculum = _after(1, 1, 1, 1)
    assert _after(0, 1, 0, 0, curriculum=curriculum).difficulty == 0.2
    assert _after(0, 0, 0, 0, curriculum=curriculum).difficulty == 0.2


def test_without_a_lower_threshold_it_never_falls():
    curriculum = Curriculum(CurriculumConfig(start=0.2, step=0.3, window=4, raise_at=0.75))
    _after(1, 1, 1, 1, *[0] * 20, curriculum=curriculum)
    assert curriculum.difficulty == 0.5


def test_ten_steps_of_a_tenth_reach_1():
    curriculum = Curriculum(CurriculumConfig(step=0.1, window=1))
    assert _after(*[1] * 10, curriculum=curriculum).difficulty == 1.0


def test_episodes_of_another_difficulty_do_not_count():
    curriculum = _after(1, 1, 1)
    curriculum.count(True, 0.5)
    assert curriculum.difficulty == 0.2
    assert _after(curriculum=curriculum).success_rate == 1.0


def test_it_goes_on_from_its_state():
    curriculum = _after(1, 1, 1, 1, 0, 1)
    other = Curriculum(CONFIG)
    other.restore(curriculum.state())
    assert (other.difficulty, other.success_rate) == (0.5, 0.5)
    assert _after(1, 1, curriculum=other).difficulty == pytest.approx(0.8)
