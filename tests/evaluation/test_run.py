import dataclasses
import json

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

import flyrl.progress
from flyrl.evaluation import EvaluationConfig, evaluate, load_results, write_results
from flyrl.evaluation.entrants import make_entrants
from flyrl.evaluation.run import walk_examples
from flyrl.report.html import format_report
from flyrl.simulation.physics import PRESET_VERSIONS
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.tasks import TASKS

SHORT = dataclasses.replace(TASKS["target"](), time_limit_s=0.2)
CONFIG = EvaluationConfig(
    task=SHORT,
    controllers=("cpg", "zero"),
    episodes=3,
    film=(2, 0),
    reference="zero",
    physics="fast",
    num_threads=1,
    command="flyrl-evaluate episodes=3",
)


@pytest.fixture(scope="module")
def results():
    return evaluate(CONFIG)


def test_everyone_walks_the_same_episodes_and_the_protocol_says_what_was_asked_for(results):
    numbers = results.episodes.groupby("controller")[["episode", "seed"]]
    for _, own in numbers:
        assert list(own.itertuples(index=False)) == list(enumerate(CONFIG.seeds()))
    starts = np.array([path.position_w[0] for path in results.trajectories.values()])
    np.testing.assert_array_equal(starts[:3], starts[3:])
    drawn = CONFIG.draw_episodes(CONFIG.terrain_configs[0])
    assert list(results.drawn["flat"]) == [
        json.loads(json.dumps(dataclasses.asdict(episode))) for episode in drawn
    ]
    protocol = results.protocol
    assert protocol["physics_preset"] == {"name": "fast", "version": PRESET_VERSIONS["fast"]}
    assert protocol["command"] == "flyrl-evaluate episodes=3"
    # the reference is the one that was named, though cpg is better
    cpg, zero = results.summaries
    assert (protocol["reference"], zero["paired"]) == ("zero", None)
    assert cpg["paired"]["reference"] == "zero"
    assert cpg["metrics"]["path_length_mm"]["median"] > 1.0
    assert zero["metrics"]["path_length_mm"]["median"] < 0.5


def test_random_ground_and_flies_are_the_same_for_everybody_and_in_any_batch():
    config = dataclasses.replace(
        CONFIG,
        controllers=("cpg", "hybrid"),
        terrains=("random_blocks",),
        reference="hybrid",
        randomisation=RandomisationConfig(mass=(0.5, 1.5)),
    )
    together = evaluate(config)
    (terrain,) = together.protocol["terrains"]
    assert (terrain["name"], terrain["config"]["random"]) == ("random_blocks", True)
    assert together.protocol["randomisation"]["mass"] == [0.5, 1.5]
    masses = [episode["randomisation"]["mass"] for episode in together.drawn["random_blocks"]]
    env = config.env("random_blocks")
    assert masses == [env.sample_episode(seed).randomisation.mass for seed in config.seeds()]
    assert len(set(masses)) == 3
    one_by_one = evaluate(dataclasses.replace(config, num_envs=1, controllers=("hybrid",)))
    np.testing.assert_array_equal(
        [path.position_w[-1] for path in list(together.trajectories.values())[3:]],
        [path.position_w[-1] for path in one_by_one.trajectories.values()],
    )
    report = format_report(together)
    assert "<pre>mass=[0.5, 1.5]</pre>" in report
    assert "same randomisation, drawn anew for every episode" in report


@pytest.mark.parametrize("num_envs", [2, 64])
def test_batches_and_threads_change_nothing_and_as_many_paths_are_kept_as_asked_for(
    results, num_envs
):
    few = evaluate(dataclasses.replace(CONFIG, paths=1, num_envs=num_envs, num_threads=2))
    assert_frame_equal(few.episodes, results.episodes)
    assert few.summaries == results.summaries
    assert list(few.trajectories) == [0, 3]
    for row, path in few.trajectories.items():
        np.testing.assert_array_equal(path.position_w, results.trajectories[row].position_w)


class Ended(BaseException):
    """An interruption, which no evaluation catches."""


class EndsAfter:
    """A policy that stands, and ends everything at its n-th decision."""

    def __init__(self, decisions, error):
        self.decisions, self.error = decisions, error

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        self.decisions -= 1
        if self.decisions < 0:
            raise self.error
        return np.full((len(observation), 2), -1 / 3, np.float32), state


def with_policy(*policy, **changes):
    return dataclasses.replace(CONFIG, policies=(EndsAfter(*policy),), **changes)


def test_an_entrant_that_crashes_is_on_record_and_the_rest_go_on(results, tmp_path):
    error = RuntimeError("the policy's own\x1b[2J\n" + 2000 * "!")
    with_crash = evaluate(with_policy(4, error, reference="EndsAfter"))
    assert_frame_equal(with_crash.episodes, results.episodes)
    (crash,) = with_crash.protocol["crashes"]
    assert (crash["controller"], crash["terrain"]) == ("EndsAfter", "flat")
    assert crash["error"].startswith("RuntimeError: the policy's own?[2J !!!")
    assert len(crash["error"]) < 1100
    assert "in predict" in crash["traceback"]
    # the reference itself is out: another takes its place
    assert with_crash.protocol["reference"] == "cpg"
    write_results(with_crash, tmp_path)
    assert load_results(tmp_path).protocol == with_crash.protocol


def test_a_bar_that_is_drawn_at_every_decision_of_a_part_of_a_millisecond_stops_nobody(
    monkeypatch,
):
    monkeypatch.setattr(flyrl.progress, "FILE_INTERVAL_S", 0.0)
    task = dataclasses.replace(TASKS["hybrid_turning"](), time_limit_s=0.01)
    config = dataclasses.replace(
        CONFIG, task=task, physics="balanced", episodes=2, film=(), progress=True
    )
    assert config.env("flat").decision_interval_s == 0.0004  # of two flies 0.8 ms, no whole number
    assert not evaluate(config).protocol["crashes"]


def test_without_anybody_left_there_are_no_results():
    with pytest.raises(ValueError, match="every entrant raised an error; the first: KeyError"):
        evaluate(with_policy(0, KeyError("nothing"), controllers=(), reference=None))


def test_an_interrupted_evaluation_goes_on_where_it_was(tmp_path):
    changes = {"num_envs": 1, "reference": None}
    whole = evaluate(with_policy(10_000, None, **changes))
    # ten decisions an episode: in the third and last one
    with pytest.raises(Ended):
        evaluate(with_policy(25, Ended(), **changes), tmp_path)
    assert len(list(tmp_path.glob("parts/*"))) == 2
    resumed = evaluate(with_policy(10, Ended(), **changes), tmp_path)  # enough for that one alone
    assert_frame_equal(resumed.episodes, whole.episodes, check_exact=True)
    assert resumed.summaries == whole.summaries
    paths = [
        {row: vars(path) for row, path in each.trajectories.items()} for each in (resumed, whole)
    ]
    np.testing.assert_equal(*paths)


def test_examples_are_the_episodes_that_were_evaluated_to_the_bit(results):
    entrants = make_entrants(CONFIG)
    kept = walk_examples(CONFIG, entrants, results.examples)
    assert set(map(id, kept)) == set(map(id, results.examples))
    order = [(record.index, record.controller) for record in kept]
    assert order == [(2, "cpg"), (2, "zero"), (0, "cpg"), (0, "zero")]
    for record, again in zip(kept, walk_examples(CONFIG, entrants), strict=True):
        np.testing.assert_array_equal(record.position_w, again.position_w)
        np.testing.assert_array_equal(record.gait.stance, again.gait.stance)
    path = results.trajectories[2].position_w
    np.testing.assert_array_equal(kept[0].position_w.astype(np.float32), path)


def straight(time_s, observation):
    """A drive of one's own."""
    return 1.0, 1.0


def test_a_resumed_evaluation_films_the_same_contrast(tmp_path):
    config = dataclasses.replace(
        CONFIG,
        task=dataclasses.replace(TASKS["traverse"](), time_limit_s=0.2),
        policies=(straight,),
        controllers=("zero",),
        film="contrast",
    )
    whole = evaluate(config, tmp_path)
    chosen = whole.protocol["film"]
    ways = whole.episodes.set_index(["controller", "episode"])["advance_mm"]
    farthest = (ways["straight"] - ways["zero"]).abs().idxmax()
    assert (chosen["flat"]["episode"], chosen["flat"]["metric"]) == (farthest, "advance_mm")
    resumed = evaluate(config, tmp_path)  # every batch lies there
    assert resumed.protocol["film"] == chosen
    shown = walk_examples(config, make_entrants(config), whole.examples, chosen)
    order = [(record.index, record.controller) for record in shown]
    assert order == [(farthest, "straight"), (farthest, "zero")]
    path = whole.trajectories[farthest].position_w
    np.testing.assert_array_equal(shown[0].position_w.astype(np.float32), path)
