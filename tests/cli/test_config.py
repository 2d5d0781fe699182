"""From composed settings to the dataclasses."""

import contextlib
import copy
import functools
import importlib.util
import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from omegaconf import OmegaConf
from PIL import Image

from flyrl.bodies.fly import FLIES
from flyrl.cli import groups as config_groups
from flyrl.cli.arguments import composed
from flyrl.cli.config import (
    evaluation_config,
    evaluation_settings,
    group,
    training_config,
)
from flyrl.envs.core import EnvConfig
from flyrl.resources import configs_folder
from flyrl.simulation.randomisation import RandomisationConfig
from flyrl.tasks import TASKS
from flyrl.terrains import TERRAINS
from flyrl.training.algorithms import ALGORITHMS
from flyrl.training.config import (
    CurriculumConfig,
    TrainingConfig,
    config_from_keywords,
    training_record,
)
from flyrl.training.loggers import LOGGERS
from flyrl.training.runs import flat


def _composed(*overrides, name="train"):
    return composed(name, overrides)


def _names(group):
    return {path.stem for path in (configs_folder() / group).glob("*.yaml")}


@pytest.mark.parametrize(
    "kept", [None, "damaged", {"sources": "of earlier sources", "groups": {}}, [], {"sources": 1}]
)
def test_groups_are_made_anew_unless_kept_of_the_same_sources(kept, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path))
    file = Path(importlib.util.cache_from_source(config_groups.__file__)).with_suffix(".json")
    file.parent.mkdir(parents=True)
    if kept is not None:
        file.write_text(kept if isinstance(kept, str) else json.dumps(kept))
    made = config_groups.groups.__wrapped__()
    assert made["body"].keys() >= FLIES.keys()
    monkeypatch.setattr(config_groups, "_make_groups", None)
    assert config_groups.groups.__wrapped__() == made


def test_the_config_is_printed_without_libraries_of_simulations():
    code = (
        "import sys; sys.argv[1:] = ['--cfg', 'job']; from flyrl.cli.train import main; main(); "
        "print({'torch', 'mujoco', 'numba', 'scipy', 'pandas', 'PIL'} & {*sys.modules})"
    )
    config_groups.groups()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("set()\n")


@pytest.mark.parametrize("name", sorted({*TASKS} - {"joints", "joints_box"}))
def test_tasks(name):
    limit = {"time_limit": 3.0} if name == "hybrid_turning" else {}
    config = training_config(_composed(f"task={name}"))
    assert config.env.resolved_task == TASKS[name](**limit).flattened()
    assert config.env.scene == EnvConfig(name).scene  # a worm's brings one without a controller


def test_the_task_is_that_of_a_users_own_worm_whose_profile_is_found_from_any_folder(
    tmp_path, monkeypatch
):
    short = training_config(_composed("task=worm_crawl", "body.segments=4")).env
    assert (short.scene.body.segments, short.resolved_task.actions.size) == (4, 6)
    path = tmp_path / "here" / "own.png"
    path.parent.mkdir()
    Image.new("RGB", (7, 1), (200, 0, 0)).save(path)
    monkeypatch.chdir(path.parent)
    config = training_config(_composed("task=worm_hang", "body.profile=own.png"))
    assert config.env.resolved_task.actions.pools == (7,) * 8  # two muscles at each of four joints
    record = training_record(config)
    monkeypatch.chdir(tmp_path)
    assert training_config(record).env.scene.body.profile_path == path
    fly = training_config(_composed("body=fly_muscles", f"body.muscles.profile={path}")).env
    assert fly.scene.body.muscles.profile_path == path


@pytest.mark.parametrize("name", sorted(_names("tuned")))
def test_tuned_settings_hold_for_their_task_and_algorithm_alone(name):
    task, algo = next(
        (task, algo) for task in TASKS for algo in ALGORITHMS if f"{task}_{algo}" == name
    )
    choices = [f"task={task}", f"algo={algo}"]
    tuned, plain = _composed(*choices), _composed(*choices, "~tuned")
    loaded = OmegaConf.load(configs_folder() / "tuned" / f"{name}.yaml")
    own = flat(OmegaConf.to_container(loaded))
    assert flat(tuned) == {**flat(plain), **own}
    assert not own.items() & flat(plain).items()  # nothing is said that holds anyway
    ours = training_record(config_from_keywords(task, algo))  # as flyrl.train has them
    assert ours == training_record(training_config(tuned))


def test_the_box_variant_of_a_task_takes_the_settings_that_were_tuned_for_whole_numbers():
    variant, task = (
        training_config(_composed(f"task=worm_{each}")) for each in ("hang_box", "hang")
    )
    assert (variant.algo, variant.training) == (task.algo, task.training)
    assert config_from_keywords("worm_hang_box", "ppo").algo.settings["n_steps"] == 32


def test_a_setting_on_the_command_line_beats_the_tuned_one():
    config = training_config(_composed("task=traverse", "algo.log_std_init=-3"))
    assert config.algo.settings["log_std_init"] == -3


def test_keys_reach_the_settings():
    given = "training.curriculum.enabled=true algo.learning_rate=1e-3 terrain=blocks"
    given += " terrain.random=true terrain.height_range=[0.15,0.45] task.decision_interval=0.01"
    given += " task.time_limit=1.5 task.weights.progress=0.1 randomisation.missing_leg=[LF,RH]"
    config = training_config(_composed(*given.split(), "randomisation.mass=[0.5,2]"))
    task = config.env.resolved_task
    assert config.algo.settings["learning_rate"] == 1e-3
    assert config.training.curriculum == CurriculumConfig(enabled=True)
    assert config.env.scene.terrain == TERRAINS["random_blocks"]
    drawn_from = RandomisationConfig(mass=(0.5, 2.0), missing_leg=("LF", "RH"))
    assert config.env.resolved_randomisation == drawn_from
    usual = {term.name: term.weight for term in TASKS["target"]().reward}
    assert {term.name: term.weight for term in task.reward} == {**usual, "progress": 0.1}
    assert task.time_limit_s == 1.5
    assert config.env.steps_per_decision == round(0.01 / config.env.scene.physics.timestep)


@pytest.mark.parametrize(
    "overrides",
    [
        ["algo=sac", "terrain=mixed", "randomisation=lesion", "seed=3"],
        ["task=worm_hang_box", "body.hinge_axes=[y,z]", "task.weights.error=-2"],
        *([f"logger={name}"] for name in LOGGERS),
    ],
)
def test_config_of_a_run_folder_reads_back(overrides):
    config = training_config(_composed(*overrides))
    again = training_config(yaml.safe_load(yaml.safe_dump(training_record(config))))
    assert training_record(again) == training_record(config)
    assert again.logger == config.logger
    assert config.logger in (None, *(kind() for kind in LOGGERS.values()))


def test_a_config_from_before_randomisation_has_none():
    record = training_record(TrainingConfig())
    del record["randomisation"]
    assert training_record(training_config(record)) == training_record(TrainingConfig())


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("algo.name=td4", r"algo\.name must be one of 'ppo', .*, got 'td4'; did you mean 'td3'"),
        ("+terrain.hight_range=[0,1]", "terrain has no 'hight_range'"),
        ("logger.name=wanb", r"logger.name must be one of 'none', 'wandb', 'mlflow'"),
        ("seed=x", "seed must be a whole number from 0 to .*, got .x."),
        ("task.name=tarket", "'tarket'"),
        ("randomisation.mass=2", r"randomisation\.mass must be a list, got 2"),
        ("training.num_envs=-1", r"training\.num_envs must be a whole number from 1 to 100000"),
    ],
)
def test_bad_values(override, message):
    with pytest.raises(ValueError, match=message):
        training_config(_composed(override))


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("film=contrast", {"film": "contrast"}),
        ("film=7", {"film": (7,)}),
        ("film=[7,0]", {"film": (7, 0)}),
        (
            "vary={friction: [0.5, 1], missing_legs: [[], [LM, RM]]}",
            {"vary": {"friction": (0.5, 1.0), "missing_legs": ((), ("LM", "RM"))}},
        ),
    ],
)
def test_keys_reach_an_evaluation(override, expected):
    composed = _composed(override, name="evaluate")
    config = evaluation_config(composed, evaluation_settings(composed), "")
    assert {name: getattr(config, name) for name in expected} == expected


def test_an_evaluation_takes_terrains_by_name_and_by_settings():
    random = {"name": "blocks", "height_range": [0.2, 0.3], "random": True}
    terrains = ["flat", {"name": "blocks", "height_range": [0.15, 0.45]}, random, "random_mixed"]
    composed = {**_composed(name="evaluate"), "terrains": terrains}
    config = evaluation_config(composed, evaluation_settings(composed), "")
    labels = [terrain.label for terrain in config.terrain_configs]
    assert labels == ["flat", "blocks", "random_blocks", "random_mixed"]
    assert config.terrain_configs[1].height_range == (0.15, 0.45)


ODD = (None, True, 5, -1, 10**9, 10**400, 1e-12, 1e308, math.nan, math.inf, "", "abc", [], {}, [[]])


def _paths(tree, start=()):
    """Keys of every group and value."""
    for key, value in tree.items():
        yield (*start, key)
        if isinstance(value, dict):
            yield from _paths(value, (*start, key))


@pytest.mark.parametrize("name", ["train", "evaluate"])
def test_every_key_takes_an_odd_value_or_refuses_it(name):
    settings = _composed(name=name)
    for *groups, last in _paths(settings):
        for value in (*ODD, "missing"):
            changed = copy.deepcopy(settings)
            keys = functools.reduce(dict.__getitem__, groups, changed)
            keys[last] = value
            if value == "missing":
                del keys[last]
            # an error of another class would be a traceback
            with contextlib.suppress(ValueError):
                if name == "train":
                    training_config(changed)
                    evaluation_settings(group(changed, "evaluation"))
                else:
                    evaluation_config(changed, evaluation_settings(changed), "")
