from itertools import pairwise

import pytest
from omegaconf import OmegaConf

from flyrl.cli.arguments import by_present_name, check_arguments, composed
from flyrl.resources import configs_folder


@pytest.mark.parametrize(
    ("command", "arguments", "message"),
    [
        ("train", ["sed=1"], "there is no key 'sed'; did you mean 'seed'."),
        ("train", ["algo.learning_rte=1"], r"no key .*; did you mean 'algo\.learning_rate'"),
        ("train", ["terrain=gaped"], "terrain must be one of 'air', .*; did you mean 'gapped'"),
        ("train", ["terrain=null"], "a group takes the name of a choice, got terrain=null"),
        ("train", ["experiment=man"], "experiment must be one of .*, got 'man'; did you mean"),
        ("train", ["experiment=lesions"], "experiment=lesions is for another command: it sets co"),
        ("train", ["seed"], "'seed' cannot be read: settings are written key=value, as task=t"),
        ("train", ["=3"], "'=3' names no key"),
        ("train", ["algo.device=cuda"], r"no key 'algo\.device': training runs on the CPU"),
        ("train", ["hydra.run.dri=x"], r"hydra\.run\.dri"),
        ("train", ["launcher=jolib"], "launcher must be one of 'joblib', .*; did you mean 'jobl"),
        ("train", ["launcher=joblib", "hydra.launcher.njobs=2"], r"hydra\.launcher\.njobs"),
        ("train", ["+nmu_envs=3"], r"there is no key 'nmu_envs' \(--cfg job prints all keys\)"),
        ("train", ["++sed=3"], "there is no key 'sed'; did you mean 'seed'"),
        ("train", ["runs_folder=é"], "'runs_folder=é' cannot be read: .*; write unusual values"),
        ("train", ["seed=0,1"], "seed=0,1 names several values: add -m to run each of them"),
        ("train", ["-m", "algo=sac,pp0"], "algo must be one of .*, got 'pp0'; did you mean 'ppo'"),
        ("train", ["-m", "algo=sac,ppo", "algo.tau=0.01"], r"there is no key 'algo\.tau'"),
        ("train", ["algo=ppo", "algo.her=true"], r"here, only with algo=ddpg,sac,td3,tqc$"),
        (
            "train",
            ["task=path", "algo=sac", "algo.n_steps=5"],
            r"no default for 'algo\.n_steps': add it by \+",
        ),
        (
            "train",
            ["algo.clip_range_vf=0.2"],
            r"ppo has no default .* add it by \+algo\.clip_range_vf=",
        ),
        ("train", ["task=worm_crawl", "controller=cpg"], "controller=cpg has no effect with task"),
        ("evaluate", ["algo.her=true"], r"there is no key 'algo\.her' \(--cfg job"),
        ("evaluate", ["--cfg", "job", "episdes=1"], "no key 'episdes'; did you mean 'episodes'"),
        ("evaluate", ["terrain=flat"], "there is no key 'terrain'; did you mean 'terrains'"),
        ("evaluate", ["terrains={}"], "terrains={}: .*ListConfig"),
    ],
)
def test_what_cannot_be_meant(command, arguments, message):
    with pytest.raises(ValueError, match=message):
        check_arguments(command, arguments)


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


def test_the_jobs_of_a_sweep():
    sweep = check_arguments("train", ["-m", "seed=range(2)", "algo=ppo,sac"])
    assert sweep.jobs == tuple(
        (f"seed={seed}", f"algo={algo}") for seed in (0, 1) for algo in ("ppo", "sac")
    )
    assert sweep.folder.parts[:2] == ("runs", "sweeps")


def test_a_launcher_makes_a_sweep_whose_jobs_do_not_name_it():
    sweep = check_arguments(
        "train", ["launcher=joblib", "hydra.launcher.n_jobs=2", "seed=1", "hydra.sweep.dir=x"]
    )
    assert sweep.jobs == (("seed=1",),)
    assert str(sweep.folder) == "x"


@pytest.mark.parametrize("arguments", [["hydra.run.dir=x"], ["launcher=joblib", "--cfg", "job"]])
def test_what_hydra_has_to_do_itself(arguments):
    assert check_arguments("train", arguments) is None


def test_the_config_of_a_run_is_what_hydra_composes():
    config = check_arguments("train", ["seed=1", "task=path"])
    settings = OmegaConf.to_container(config, resolve=False)
    assert settings.pop("hydra")["overrides"]["task"] == ["seed=1", "task=path"]
    assert OmegaConf.to_container(OmegaConf.create(settings), resolve=True) == composed(
        "train", ["seed=1", "task=path"]
    )


def test_things_of_ones_own_are_choices_that_take_any_key():
    own = ["task=my_lab:forage", "task.sources=2", "terrain=mixed,lab:Stairs"]
    written = [r"task=my_lab\:forage", "task.sources=2"]  # as Hydra writes it
    for overrides in (own[:2], written):
        assert composed("train", overrides)["task"] == {"name": "my_lab:forage", "sources": 2}
    sweep = check_arguments("train", ["-m", *own, "controller=cpg,lab:Wave"])
    assert len(sweep.jobs) == 4
    assert sweep.jobs[3] == (*written, r"terrain=lab\:Stairs", r"controller=lab\:Wave")


def test_an_earlier_name_is_understood_and_warned_of(capsys):
    given = ["training.total_decisions=100", "++training.total_decisions=5", "seed=1"]
    present = ["training.total_timesteps=100", "++training.total_timesteps=5", "seed=1"]
    assert [*map(by_present_name, given)] == present
    warning = "warning: training.total_decisions is called training.total_timesteps"
    assert capsys.readouterr().err.splitlines() == [warning] * 2
