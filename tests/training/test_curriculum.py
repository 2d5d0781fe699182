import pytest

from flyrl.training.callback import Curriculum
from flyrl.training.config import CurriculumConfig

CONFIG = CurriculumConfig(enabled=True, start=0.2, step=0.3, window=4, raise_at=0.75, lower_at=0.25)
NEVER_LOWER = CurriculumConfig(enabled=True, start=0.2, step=0.3, window=4, raise_at=0.75)
TENTHS = CurriculumConfig(enabled=True, step=0.1, window=1)


def after(successes, config):
    curriculum = Curriculum()
    for is_success in successes:
        difficulty = curriculum.difficulty(config)
        curriculum = curriculum.after(config, bool(is_success), difficulty)
    return curriculum


@pytest.mark.parametrize(
    ("config", "successes", "difficulty"),
    [
        (CONFIG, [], 0.2),
        # it waits for a full window, in which the latest episodes count
        (CONFIG, [1, 1, 1], 0.2),
        (CONFIG, [1, 1, 0, 1], 0.5),
        (CONFIG, [0, 0, 1, 1, 0], 0.2),
        (CONFIG, [0, 0, 1, 1, 0, 1], 0.5),
        # a change begins a new window
        (CONFIG, [1] * 7, 0.5),
        # it ends at 1, and does not fall below the start
        (CONFIG, [1] * 12, 1.0),
        (CONFIG, [1] * 40, 1.0),
        (CONFIG, [1] * 4 + [0, 1, 0, 0], 0.2),
        (CONFIG, [1] * 4 + [0] * 20, 0.2),
        (NEVER_LOWER, [1] * 4 + [0] * 20, 0.5),
        (TENTHS, [1] * 10, 1.0),
        (CurriculumConfig(), [0], 1.0),
    ],
)
def test_difficulty_by_hand(config, successes, difficulty):
    assert after(successes, config).difficulty(config) == difficulty


def test_episodes_of_another_difficulty_do_not_count():
    before = after([1, 1, 1], CONFIG)
    assert before.after(CONFIG, is_success=True, difficulty=0.5) == before
