import dataclasses
import hashlib
from pathlib import Path

import numpy as np
import pytest

from flyrl.controllers import CPG, Hybrid
from flyrl.evaluation import EvaluationConfig, make_entrants
from flyrl.evaluation.entrants import NAME_LENGTH, free_name
from flyrl.policies import export_sb3, load_bundle, observation_layout
from flyrl.policies.bundle import TermLayout, save_bundle
from flyrl.policies.laws import FIXED
from flyrl.tasks import TASKS
from tests.bundles import target_bundle

TARGET = TASKS["target"]()


def save_policy(path, **fields):
    """A policy that always answers (0.5, -0.5)."""
    usual = {"env": {"controller": dataclasses.asdict(Hybrid())}, "training": {"algo": "ppo"}}
    save_bundle(target_bundle((0.5, -0.5), **{**usual, **fields}), path)
    return str(path)


def made(**settings):
    return make_entrants(EvaluationConfig(**{"controllers": (), **settings}))


def names(entrants):
    return [entrant.name for entrant in entrants]


def zeros(task, count=1):
    return np.zeros((count, sum(term.size for term in task.observation)), np.float32)


@pytest.mark.parametrize(
    ("name", "taken", "free"),
    [
        ("target-ppo", (), "target-ppo"),
        ("<b>x</b>", (), "b_x__b_"),
        ("=1+1", (), "1+1"),
        ("-a\x1b[2J\tb", (), "a__2J_b"),
        ("@\r", (), "unnamed"),
        ("x" * 1000, (), "x" * NAME_LENGTH),
        ("a<", ("a_",), "a_-2"),
    ],
)
def test_names_are_short_printable_text(name, taken, free):
    assert free_name(name, taken) == free


def test_learned_policies_come_first_and_namesakes_are_numbered(tmp_path):
    path = save_policy(tmp_path / "a.safetensors")
    unknown = save_policy(tmp_path / "mine.safetensors", training={})
    entrants = made(policies=(path, unknown, path), controllers=("cpg", "zero"))
    assert names(entrants) == ["ppo", "mine", "ppo-2", "cpg", "zero"]


def test_a_learned_policy_brings_its_legs_its_decision_interval_and_its_record(tmp_path):
    legs = CPG(frequency_hz=10.0)
    env = {
        "controller": dataclasses.asdict(legs),
        "task": {"decision_interval": 0.05},
        "terrain": {"name": "blocks", "random": True},
    }
    path = save_policy(tmp_path / "a.safetensors", env=env)
    config = EvaluationConfig(policies=(path,), controllers=())
    (entrant,) = make_entrants(config)
    env_config = entrant.env(config, config.terrain_configs[0])
    assert env_config.scene.controller == dataclasses.replace(legs, steps="untethered")
    assert env_config.decision_interval_s == pytest.approx(0.05)
    assert entrant.record["policy"] == "learned with ppo on random_blocks"
    assert entrant.record["source"] == path
    assert entrant.record["sha256"] == hashlib.sha256(Path(path).read_bytes()).hexdigest()


def test_what_steers_can_be_put_on_other_legs(tmp_path):
    path = save_policy(tmp_path / "a.safetensors")
    entrants = made(
        policies=(f"{path}@cpg", f"{path}@rule_based_steered"),
        controllers=("pursuit", "pursuit@cpg", "constant(1.2, 0.4)@cpg"),
    )
    assert {each.name: each.controller.name for each in entrants} == {
        "ppo@cpg": "cpg",
        "ppo@rule_based_steered": "rule_based_steered",
        "pursuit": "hybrid",
        "pursuit@cpg": "cpg",
        "constant(1.2, 0.4)@cpg": "cpg",
    }


def test_legs_with_settings_are_entrants_at_the_drive_of_the_usual_ones():
    wave, usual = made(controllers=({"name": "cpg", "gait": "wave"}, "cpg"))
    assert (wave.name, usual.name) == ("cpg(gait=wave)", "cpg")
    assert wave.controller == dataclasses.replace(usual.controller, gait="wave")
    assert wave.record["policy"] == usual.record["policy"] == "constant drive (1, 1)"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        # names the terms, and imports nothing
        (
            {
                "env": {"task": {"name": "target", "terms": ["no_such_module:HEIGHT"]}},
                "observation": (*observation_layout(TARGET), TermLayout("height", 1)),
            },
            r": .*does not show: height \(1 values\), here it is missing; it was "
            r"trained with task\.terms=\[no_such_module:HEIGHT\], here it is task\.terms=\[\]",
        ),
        ({"env": {"controller": {"name": "wheels"}}}, ": its leg controller.*'wheels'"),
        ({"env": {"controller": []}}, ": its leg controller"),
        ({"env": {"controller": {"name": "rule_based"}}}, ".*'rule_based', ignores the drive"),
        # no whole number of the physics' steps
        ({"env": {"task": {"decision_interval": 0.00025}}}, " cannot walk here: decision_interval"),
    ],
)
def test_a_policy_file_that_cannot_be_used_here(tmp_path, fields, message):
    path = save_policy(tmp_path / "a.safetensors", **fields)
    with pytest.raises(ValueError, match=rf"a\.safetensors{message}"):
        made(policies=(path,), physics="fast")


@pytest.mark.parametrize(
    ("name", "drive"), [("cpg", (1, 1)), ("zero", (0, 0)), ("constant(1.2, 0.4)", (1.2, 0.4))]
)
def test_constant_drives(name, drive):
    (entrant,) = made(controllers=(name,))
    assert entrant.controller.name == ("cpg" if name == "cpg" else "hybrid")
    action, _ = entrant.policy.predict(zeros(TARGET, 3))
    np.testing.assert_allclose(TARGET.actions.commands(action), [drive] * 3, atol=1e-6)


@pytest.mark.parametrize(
    ("task", "others"),
    [
        ("target", ("open_loop", "closed_loop")),
        ("target_goal", ("unhurried", "open_loop", "closed_loop")),
        ("velocity", ("pursuit", "unhurried")),
    ],
)
def test_by_default_all_fixed_controllers_that_go_with_the_task_take_part(task, others):
    usual = [name for name, law in FIXED.items() if law.is_usual and law.legs is not None]
    entrants = made(task=task, controllers=None)
    assert names(entrants) == [name for name in usual if name not in others]


@pytest.mark.parametrize(
    ("name", "body", "setting", "value"),
    [
        ("cpg", "classic", "steps", "tethered"),  # the recorded step of that body
        ("hybrid_current", "current", "reflexes", "current"),
        ("hybrid_classic", "current", "reflexes", "classic"),
    ],
)
def test_the_body_and_the_name_decide_on_steps_and_reflexes(name, body, setting, value):
    (entrant,) = made(controllers=(name,), body=body)
    assert entrant.controller.name == name.partition("_")[0]
    assert getattr(entrant.controller, setting) == value


@pytest.fixture
def own_policies(own_module):
    """A module of a user's own in the current folder, imported anew."""
    return own_module(
        "own_policies",
        "from flyrl.policies import ConstantDrive\n"
        "def steady(task):\n"
        "    return ConstantDrive(0.5, 0.5, task)\n"
        "def broken(task):\n"
        "    raise KeyError('nothing')\n"
        "def nothing(task):\n"
        "    return 3\n"
        "def law(time_s, observation):\n"
        "    return 0.5 + time_s, 1\n",
    )


def test_a_factory_of_a_users_own_makes_an_entrant(own_policies):
    entrant, hybrid = made(policies=("own_policies:steady",), controllers=("hybrid",))
    assert entrant.name == "steady"
    assert entrant.controller == hybrid.controller
    assert entrant.record["sha256"] == hashlib.sha256(own_policies.read_bytes()).hexdigest()
    action, _ = entrant.policy.predict(np.zeros((2, 1)))
    np.testing.assert_allclose(TARGET.actions.commands(action), 0.5, atol=1e-6)


def test_a_function_of_time_and_observation_is_an_entrant(own_policies):
    (entrant,) = made(policies=("own_policies:law",))
    assert (entrant.name, entrant.record["source"]) == ("law", "own_policies:law")
    first, state = entrant.policy.predict(zeros(TARGET))
    second, _ = entrant.policy.predict(zeros(TARGET), state)
    drives = TARGET.actions.commands(np.concatenate([first, second]))
    np.testing.assert_allclose(drives, [[0.5, 1.0], [0.52, 1.0]], atol=1e-6)


@pytest.fixture(scope="module")
def sb3_model(tmp_path_factory):
    """The zip file of a model that nobody trained."""
    path = tmp_path_factory.mktemp("sb3") / "model.zip"
    export_sb3(load_bundle("target-flat")).save(path)
    return path


def test_a_model_of_stable_baselines3_takes_part(sb3_model):
    policies = ("target-flat", f"ppo:{sb3_model}")
    own, imported, hybrid = made(policies=policies, controllers=("hybrid",), trust_pickles=True)
    assert (imported.name, imported.controller) == ("ppo", hybrid.controller)
    assert imported.record["sha256"] == hashlib.sha256(sb3_model.read_bytes()).hexdigest()
    # the file does not say what its model was trained in
    assert imported.record["trained_in"] == {}
    assert imported.record["policy"] == "learned with ppo on unknown ground"
    size = own.policy.bundle.num_inputs
    observation = np.random.default_rng(0).normal(size=(4, size)).astype(np.float32)
    actions = [each.policy.predict(observation)[0] for each in (own, imported)]
    np.testing.assert_allclose(*actions, atol=1e-6)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"controllers": ("cpg", "rule_basd")}, "rule_based.*'rule_basd'.*mean 'rule_based'"),
        ({"controllers": (CPG(), "hybrid", "cpg")}, "controllers must not hold 'cpg' twice"),
        ({"controllers": ("open_loop",)}, "'open_loop' needs a task for flies that shows command"),
        ({"controllers": ("cpg",), "reference": "hybrid"}, "reference"),
        ({"controllers": ("constant(9, 0)",)}, "drive of 'constant"),
        ({"controllers": ("constant(1)",)}, r"constant\(left, right\)"),
        ({"controllers": ("pursuit@joints",)}, "pursuit@joints: legs after @ must .* 'joints'"),
        ({"policies": ("/nowhere/at/all",)}, "nowhere"),
        ({"policies": ("own_policies:stedy",)}, "did you mean 'steady'"),
        ({"policies": ("own_policies:broken",)}, "raised KeyError: 'nothing'"),
        ({"policies": ("own_policies:nothing",)}, "must return a policy with predict"),
        ({"policies": ("no_such_module:steady",)}, "cannot be imported: ModuleNotFoundError"),
        ({"policies": ("ppo:{zip}",)}, "was not opened"),
        ({"policies": ("{zip}",)}, "say which algorithm made it, e.g. ppo:"),
        ({"policies": ("reinforce:{zip}",)}, "algorithm of"),
    ],
)
def test_who_cannot_take_part(own_policies, sb3_model, settings, message):
    policies = tuple(name.format(zip=sb3_model) for name in settings.get("policies", ()))
    with pytest.raises(ValueError, match=message):
        made(**{**settings, "policies": policies})
