import dataclasses
import hashlib
from pathlib import Path

import numpy as np
import pytest

from flyrl.controllers import CPG, Hybrid
from flyrl.envs.core import BatchedEnv
from flyrl.evaluation import EvaluationConfig, make_entrants
from flyrl.evaluation.entrants import NAME_LENGTH, free_name
from flyrl.policies import (
    PolicyFileError,
    export_sb3,
    load_bundle,
    observation_layout,
)
from flyrl.policies.bundle import TermLayout, save_bundle
from flyrl.policies.laws import FIXED
from flyrl.tasks import TASKS
from tests.bundles import target_bundle

TARGET = TASKS["target"]()


def save_policy(path, *, training=None, env=None, observation=None):
    """A policy that always answers (0.5, -0.5)."""
    fields = {} if observation is None else {"observation": observation}
    fields["env"] = {"controller": dataclasses.asdict(Hybrid())} if env is None else env
    fields["training"] = {"algo": "ppo"} if training is None else training
    save_bundle(target_bundle((0.5, -0.5), **fields), path)
    return str(path)


def names(config):
    return [entrant.name for entrant in make_entrants(config)]


def only(**settings):
    """The one entrant of an evaluation."""
    (entrant,) = make_entrants(EvaluationConfig(**{"controllers": (), **settings}))
    return entrant


def zeros(task, count=1):
    return np.zeros((count, sum(term.size for term in task.observation)), np.float32)


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        ("target-ppo", "target-ppo"),
        ("<b>x</b>", "b_x__b_"),
        ("=1+1", "1+1"),
        ("-a\x1b[2J\tb", "a__2J_b"),
        ("@\r", "unnamed"),
        ("x" * 1000, "x" * NAME_LENGTH),
    ],
)
def test_names_are_short_printable_text(name, kept):
    assert free_name(name, ()) == kept


def test_learned_policies_come_first_and_namesakes_are_numbered(tmp_path):
    path = save_policy(tmp_path / "a.safetensors")
    unknown = save_policy(tmp_path / "mine.safetensors", training={})
    config = EvaluationConfig(policies=(path, unknown, path), controllers=("cpg", "zero"))
    assert names(config) == ["ppo", "mine", "ppo-2", "cpg", "zero"]
    assert free_name("a<", ("a_",)) == "a_-2"


@pytest.mark.parametrize(
    ("terrain", "text"),
    [({"name": "mixed"}, "mixed"), ({"name": "blocks", "random": True}, "random_blocks")],
)
def test_the_record_says_how_a_policy_was_learned_and_from_which_file(tmp_path, terrain, text):
    path = save_policy(tmp_path / "a.safetensors", env={"terrain": terrain})
    record = only(policies=(path,)).record
    assert record["policy"] == f"learned with ppo on {text}"
    assert record["source"] == path
    assert record["sha256"] == hashlib.sha256(Path(path).read_bytes()).hexdigest()


def test_a_learned_policy_brings_its_legs_and_its_decision_interval(tmp_path):
    legs = CPG(frequency_hz=10.0)
    env = {"controller": dataclasses.asdict(legs), "task": {"decision_interval": 0.05}}
    path = save_policy(tmp_path / "a.safetensors", env=env)
    config = EvaluationConfig(policies=(path,), controllers=())
    (entrant,) = make_entrants(config)
    env_config = entrant.env(config, config.terrain_configs[0])
    assert env_config.scene.controller == dataclasses.replace(legs, steps="untethered")
    assert env_config.decision_interval_s == pytest.approx(0.05)


def test_what_steers_can_be_put_on_other_legs(tmp_path):
    path = save_policy(tmp_path / "a.safetensors")
    config = EvaluationConfig(
        policies=(f"{path}@cpg", f"{path}@rule_based_steered"),
        controllers=("pursuit", "pursuit@cpg", "constant(1.2, 0.4)@cpg"),
    )
    assert {each.name: each.controller.name for each in make_entrants(config)} == {
        "ppo@cpg": "cpg",
        "ppo@rule_based_steered": "rule_based_steered",
        "pursuit": "hybrid",
        "pursuit@cpg": "cpg",
        "constant(1.2, 0.4)@cpg": "cpg",
    }


@pytest.mark.parametrize("wave", [CPG(gait="wave"), {"name": "cpg", "gait": "wave"}])
def test_legs_with_settings_are_entrants_at_the_drive_of_the_usual_ones(wave):
    own, usual = make_entrants(EvaluationConfig(controllers=(wave, "cpg")))
    assert (own.name, usual.name) == ("cpg(gait=wave)", "cpg")
    assert own.controller == dataclasses.replace(usual.controller, gait="wave")
    assert own.record["policy"] == usual.record["policy"] == "constant drive (1, 1)"


def test_legs_with_the_usual_settings_have_the_name_alone():
    with pytest.raises(ValueError, match="controllers must not hold 'cpg' twice"):
        make_entrants(EvaluationConfig(controllers=(CPG(), "cpg")))


@pytest.mark.parametrize("legs", ["rule_based", "joints"])
def test_legs_that_follow_no_drive_are_refused(legs):
    with pytest.raises(ValueError, match=f"pursuit@{legs}: legs after @ must .* got '{legs}'"):
        make_entrants(EvaluationConfig(controllers=(f"pursuit@{legs}",)))


def test_a_policy_for_other_observations_is_refused(tmp_path):
    path = save_policy(tmp_path / "a.safetensors", observation=observation_layout(TARGET)[1:])
    with pytest.raises(PolicyFileError, match=r"a\.safetensors: .*other observations"):
        make_entrants(EvaluationConfig(policies=(path,)))


def test_a_policy_of_other_terms_names_them_and_imports_nothing(tmp_path):
    height = TermLayout("height", 1)
    path = save_policy(
        tmp_path / "a.safetensors",
        env={"task": {"name": "target", "terms": ["no_such_module:HEIGHT"]}},
        observation=(*observation_layout(TARGET), height),
    )
    with pytest.raises(
        PolicyFileError,
        match=r"term 10 was height \(1 values\), here it is missing; it was trained with "
        r"task\.terms=\[no_such_module:HEIGHT\], here it is task\.terms=\[\]",
    ):
        make_entrants(EvaluationConfig(policies=(path,)))


@pytest.mark.parametrize(
    ("legs", "message"),
    [
        ({"wheels": 4}, "leg controller"),
        ({"name": "wheels"}, r"a\.safetensors: its leg controller.*'wheels'"),
        ([], "leg controller"),
        ({"name": "rule_based"}, r"a\.safetensors.*'rule_based', ignores the drive"),
    ],
)
def test_a_policy_on_legs_that_it_cannot_steer_is_refused(tmp_path, legs, message):
    path = save_policy(tmp_path / "a.safetensors", env={"controller": legs})
    with pytest.raises(PolicyFileError, match=message):
        make_entrants(EvaluationConfig(policies=(path,)))


@pytest.mark.parametrize(
    ("name", "legs", "drive"),
    [
        ("cpg", "cpg", (1, 1)),
        ("zero", "hybrid", (0, 0)),
        ("constant(1.2, 0.4)", "hybrid", (1.2, 0.4)),
    ],
)
def test_constant_drives(name, legs, drive):
    entrant = only(controllers=(name,))
    assert entrant.controller.name == legs
    action, _ = entrant.policy.predict(zeros(TARGET, 3))
    np.testing.assert_allclose(TARGET.actions.commands(action), [drive] * 3, atol=1e-6)


def test_pursuit_drives_alike_whether_it_sees_the_direction_or_goals():
    actions = []
    for task in ("target", "target_goal"):
        config = EvaluationConfig(task=task, controllers=("pursuit",))
        (entrant,) = make_entrants(config)
        env = BatchedEnv(entrant.env(config, config.terrain_configs[0]), 32)
        observation = env.reset(episodes=[env.config.sample_episode(seed) for seed in range(32)])
        actions.append(entrant.policy.predict(observation)[0])
    np.testing.assert_allclose(*actions, atol=1e-5)
    assert len(np.unique(actions[0], axis=0)) > 4


def test_a_policy_whose_decisions_do_not_fit_the_physics(tmp_path):
    env = {"task": {"decision_interval": 0.00025}}
    path = save_policy(tmp_path / "a.safetensors", env=env)
    with pytest.raises(ValueError, match=r"a\.safetensors cannot walk here: decision_interval is"):
        make_entrants(EvaluationConfig(policies=(path,), controllers=(), physics="fast"))


@pytest.mark.parametrize(
    ("task", "others"),
    [
        ("target", ("open_loop", "closed_loop")),
        ("velocity", ("pursuit",)),
        ("target_goal", ("open_loop", "closed_loop")),
    ],
)
def test_by_default_all_fixed_controllers_that_go_with_the_task_take_part(task, others):
    assert names(EvaluationConfig(task=task)) == [
        name
        for name, fixed in FIXED.items()
        if fixed.is_usual and name not in others and fixed.legs is not None
    ]


def test_the_classic_body_gets_its_own_recorded_step():
    (entrant,) = make_entrants(EvaluationConfig(controllers=("cpg",), body="classic"))
    assert entrant.controller.steps == "tethered"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"controllers": ("cpg", "rule_basd")}, "rule_based.*'rule_basd'.*mean 'rule_based'"),
        ({"controllers": ("cpg", "hybrid", "cpg")}, "'cpg' twice"),
        ({"controllers": ("open_loop",)}, "'open_loop' needs a task for flies that shows command"),
        ({"controllers": ("cpg",), "reference": "hybrid"}, "reference"),
        ({"controllers": ("constant(1.2, fast)",)}, "two numbers"),
        ({"controllers": ("constant(9, 0)",)}, "drive of 'constant"),
        ({"controllers": ("constant(1)",)}, r"constant\(left, right\)"),
        ({"policies": ("/nowhere/at/all",)}, "nowhere"),
    ],
)
def test_who_cannot_take_part(settings, message):
    with pytest.raises(ValueError, match=message):
        make_entrants(EvaluationConfig(**settings))


def test_hybrid_comes_with_either_set_of_reflexes():
    config = EvaluationConfig(controllers=("hybrid_current", "hybrid_classic"))
    current, classic = make_entrants(config)
    assert (current.controller.reflexes, classic.controller.reflexes) == ("current", "classic")
    assert current.controller.name == classic.controller.name == "hybrid"


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
        "    return 0.5 + time_s, 1\n"
        "def many(a, b, c):\n"
        "    return 1, 1\n",
    )


def test_a_factory_of_a_users_own_makes_an_entrant(own_policies):
    config = EvaluationConfig(policies=("own_policies:steady",), controllers=("hybrid",))
    entrant, _ = make_entrants(config)
    assert entrant.name == "steady"
    assert entrant.controller == config.legs
    assert entrant.record["sha256"] == hashlib.sha256(own_policies.read_bytes()).hexdigest()
    action, _ = entrant.policy.predict(np.zeros((2, 1)))
    np.testing.assert_allclose(TARGET.actions.commands(action), 0.5, atol=1e-6)


def test_a_function_of_time_and_observation_is_an_entrant(own_policies):
    entrant = only(policies=("own_policies:law",))
    assert (entrant.name, entrant.record["source"]) == ("law", "own_policies:law")
    first, state = entrant.policy.predict(zeros(TARGET))
    second, _ = entrant.policy.predict(zeros(TARGET), state)
    drives = TARGET.actions.commands(np.concatenate([first, second]))
    np.testing.assert_allclose(drives, [[0.5, 1.0], [0.52, 1.0]], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "own_policies:many",
            r"must be an object with predict\(\), a function of \(time_s, observation\)",
        ),
        ("own_policies:stedy", "did you mean 'steady'"),
        ("own_policies:broken", "raised KeyError: 'nothing'"),
        ("own_policies:nothing", "must return a policy with predict"),
        ("no_such_module:steady", "cannot be imported: ModuleNotFoundError"),
    ],
)
def test_a_factory_that_cannot_be_used(own_policies, name, message):
    with pytest.raises(ValueError, match=message):
        make_entrants(EvaluationConfig(policies=(name,), controllers=()))


@pytest.fixture(scope="module")
def sb3_model(tmp_path_factory):
    """The zip file of a model that nobody trained."""
    path = tmp_path_factory.mktemp("sb3") / "model.zip"
    bundle = load_bundle("target-flat")
    export_sb3(bundle).save(path)
    return path


def test_a_model_of_stable_baselines3_takes_part(sb3_model):
    config = EvaluationConfig(
        policies=("target-flat", f"ppo:{sb3_model}"), controllers=(), trust_pickles=True
    )
    own, imported = make_entrants(config)
    assert imported.name == "ppo"
    assert imported.record["sha256"] == hashlib.sha256(sb3_model.read_bytes()).hexdigest()
    observation = (
        np.random.default_rng(0).normal(size=(4, own.policy.bundle.num_inputs)).astype(np.float32)
    )
    np.testing.assert_allclose(
        own.policy.predict(observation)[0], imported.policy.predict(observation)[0], atol=1e-6
    )


def test_a_zip_file_does_not_say_what_its_model_was_trained_in(sb3_model):
    config = EvaluationConfig(policies=(f"ppo:{sb3_model}",), controllers=(), trust_pickles=True)
    (imported,) = make_entrants(config)
    assert imported.record["trained_in"] == {}
    assert imported.record["policy"] == "learned with ppo on unknown ground"
    assert imported.controller == config.legs


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("ppo:{}", "was not opened"),
        ("{}", "say which algorithm made it, e.g. ppo:"),
        ("reinforce:{}", "algorithm of"),
    ],
)
def test_a_zip_file_needs_its_algorithm_and_trust(sb3_model, name, message):
    with pytest.raises(ValueError, match=message):
        make_entrants(EvaluationConfig(policies=(name.format(sb3_model),), controllers=()))
