from itertools import pairwise

import pytest

from flyrl.cli.arguments import UsageError, check_arguments, unknown_key, with_own_things
from flyrl.resources import configs_folder


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("sed=1", "there is no key 'sed'; did you mean 'seed'."),
        (
            "algo.learning_rte=1",
            r"there is no key 'algo\.learning_rte'; did you mean 'algo\.learning_rate'.",
        ),
        ("terain=flat", "there is no key 'terain'; did you mean 'terrain'."),
        (
            "terrain=gaped",
            "terrain must be one of 'air', .*, got 'gaped'; did you mean 'gapped'",
        ),
        ("terrain=null", "a group takes the name of a choice, got terrain=null"),
        ("experiment=man", "experiment must be one of .*, got 'man'; did you mean 'main'"),
        ("experiment=lesions", "experiment=lesions is for another command"),
        ("seed", "'seed' cannot be read: settings are written key=value, as task=target"),
        ("=3", "'=3' names no key"),
        ("device=cuda", "no key 'device': training runs on the CPU, where the physics runs"),
        ("algo.device=cuda", r"no key 'algo\.device': training runs on the CPU"),
        ("hydra.run.dri=x", r"hydra\.run\.dri"),
        ("launcher=jolib", "launcher must be one of 'joblib', .*; did you mean 'joblib'"),
        ("+nmu_envs=3", "there is no key 'nmu_envs'"),
        ("++sed=3", "there is no key 'sed'; did you mean 'seed'"),
        ("runs_folder=é", "'runs_folder=é' cannot be read: .*; write unusual values in quotes"),
    ],
)
def test_what_cannot_be_meant(argument, message):
    with pytest.raises(UsageError, match=message):
        check_arguments("train", [argument])


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["task=target", "terrain=flat", "algo=ppo", "seed=0"],
        ["algo=sac", "algo.tau=0.01"],
        ["algo=recurrent_ppo", "algo.lstm_hidden_size=32", "algo.normalize_observation=true"],
        ["experiment=main", "training.num_envs=8"],
        ["terrain=blocks", "terrain.height_range=[0.15,0.45]"],
        ["-m", "seed=range(5)", "algo=ppo,sac"],
        ["hydra.run.dir=elsewhere"],
        ["--cfg", "job"],
        ["launcher=joblib", "hydra.launcher.n_jobs=2", "seed=range(5)"],
        ["launcher=slurm", "hydra.launcher.partition=cpu", "seed=0,1"],
        ["launcher=submitit", "hydra.launcher.timeout_min=5"],
        ["launcher=ray", "hydra.launcher.address=auto", "seed=0,1"],
        ["-m", "hydra/launcher=joblib", "seed=0,1"],
        ["-m", "algo=sac", "algo.tau=0.01,0.02"],
    ],
)
def test_what_is_fine(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_arguments("train", arguments)


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("terrain=flat", "there is no key 'terrain'; did you mean 'terrains'"),
        ("terain=flat", "there is no key 'terain'; did you mean 'terrains'"),
        ("algo=ppo", "there is no key 'algo'"),
        ("terrains={}", "terrains={}: .*ListConfig"),
    ],
)
def test_choices_of_another_command_are_unknown(argument, message):
    with pytest.raises(UsageError, match=message):
        check_arguments("evaluate", [argument])


def test_keys_of_a_choice_that_was_not_made():
    with pytest.raises(UsageError, match=r"there is no key 'algo\.tau'"):
        check_arguments("train", ["algo.tau=0.01"])


def test_a_key_of_other_choices_names_them():
    with pytest.raises(UsageError, match=r"'algo\.her' here, only with algo=ddpg,sac,td3,tqc$"):
        check_arguments("train", ["algo=ppo", "algo.her=true"])
    with pytest.raises(UsageError, match=r"there is no key 'algo\.her' \(--cfg job"):
        check_arguments("evaluate", ["algo.her=true"])


def test_choices_of_a_sweep():
    with pytest.raises(
        UsageError, match=r"algo must be one of 'a2c', .*, got 'pp0'; did you mean 'ppo'\?"
    ):
        check_arguments("train", ["-m", "algo=sac,pp0"])


def test_a_key_like_no_other_gets_no_suggestion():
    assert str(unknown_key("x", ["seed"])) == "there is no key 'x' (--cfg job prints all keys)"


BOMB = "a: &a [x, x]\n" + "".join(f"{b}: &{b} [*{a}, *{a}]\n" for a, b in pairwise("abcdefgh"))


@pytest.mark.parametrize("option", ["--config-dir", "--config-path"])
def test_a_config_with_aliases_is_refused(option, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "bomb.yaml").write_text(BOMB)
    with pytest.raises(ValueError, match=r"bomb\.yaml.*aliases \(\*name\) are not allowed"):
        check_arguments("train", [option, str(tmp_path), "experiment=bomb"])


def test_a_folder_of_more_configs_counts_beside_another_folder_of_configs(tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "mine.yaml").write_text("# @package _global_\nseed: 7\n")
    folders = ["--config-path", str(configs_folder()), "--config-dir", str(tmp_path)]
    sweep = check_arguments("train", [*folders, "-m", "experiment=mine", "algo=ppo,sac"])
    assert len(sweep.jobs) == 2


def test_keys_of_every_choice_that_is_swept():
    with pytest.raises(UsageError, match=r"there is no key 'algo\.tau'"):
        check_arguments("train", ["-m", "algo=sac,ppo", "algo.tau=0.01"])


def test_a_launcher_has_keys_of_its_own():
    with pytest.raises(UsageError, match=r"hydra\.launcher\.njobs"):
        check_arguments("train", ["launcher=joblib", "hydra.launcher.njobs=2"])


def test_the_jobs_of_a_sweep():
    sweep = check_arguments("train", ["-m", "seed=range(2)", "algo=ppo,sac"])
    assert sweep.jobs == tuple(
        (f"seed={seed}", f"algo={algo}") for seed in (0, 1) for algo in ("ppo", "sac")
    )
    assert sweep.folder.parts[:2] == ("runs", "sweeps")
    assert not sweep.is_elsewhere


def test_a_launcher_makes_a_sweep_whose_jobs_do_not_name_it():
    sweep = check_arguments(
        "train", ["launcher=joblib", "hydra.launcher.n_jobs=2", "seed=1", "hydra.sweep.dir=x"]
    )
    assert sweep.jobs == (("seed=1",),)
    assert (str(sweep.folder), sweep.is_named, sweep.is_elsewhere) == ("x", True, True)


@pytest.mark.parametrize("arguments", [["seed=1"], ["launcher=joblib", "--cfg", "job"]])
def test_no_sweep(arguments):
    assert check_arguments("train", arguments) is None


def test_a_controller_of_ones_own_is_a_group_of_its_own():
    given = ["seed=1", "controller=my_lab:Wave", "controller.amplitude=0.3", "task=path"]
    expected = [
        "seed=1", "~controller", "+controller.name=my_lab:Wave", "++controller.amplitude=0.3",
        "task=path",
    ]  # fmt: skip
    assert with_own_things(given) == expected
    assert check_arguments("train", expected) is None


def test_a_task_of_ones_own_is_the_choice_own():
    given = ["task=my_lab:forage", "task.sources=2", "task.terms=[my_terms:HEIGHT]", "seed=1"]
    expected = [
        "task=own", "task.name=my_lab:forage", "++task.sources=2",
        "++task.terms=[my_terms:HEIGHT]", "seed=1",
    ]  # fmt: skip
    assert with_own_things(given) == expected
    for command in ("train", "evaluate"):
        kept = [word for word in expected if command == "train" or word != "seed=1"]
        assert check_arguments(command, kept) is None


def test_a_sweep_may_hold_things_of_ones_own():
    given = ["-m", "controller=cpg,my_lab:Wave", "terrain=random_blocks,my_lab:Stairs"]
    expected = [
        "-m", "~controller", "+controller.name=cpg,my_lab:Wave", "~terrain",
        "+terrain.name=random_blocks,my_lab:Stairs",
    ]  # fmt: skip
    assert with_own_things(given) == expected
    sweep = check_arguments("train", expected)
    assert sweep is not None
    assert len(sweep.jobs) == 4


def test_a_built_in_controller_stays_as_it_is():
    given = ["controller=cpg", "controller.frequency_hz=9", "logger=none"]
    assert with_own_things(given) == given


def test_an_earlier_name_is_understood_and_warned_of(capsys):
    given = ["training.total_decisions=100", "++training.total_decisions=5", "seed=1"]
    present = ["training.total_timesteps=100", "++training.total_timesteps=5", "seed=1"]
    assert with_own_things(given) == present
    warning = "warning: training.total_decisions is called training.total_timesteps"
    assert capsys.readouterr().err.splitlines() == [warning] * 2
