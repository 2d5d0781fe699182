import pytest

from flyrl.cli.arguments import UsageError, check_arguments, closest


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("sed=1", "sed: no such key; closest: seed"),
        ("algo.learning_rte=1", r"algo\.learning_rte: no such key; closest: algo\.learning_rate"),
        ("terain=flat", "terain: no such key; closest: terrain"),
        ("terrain=gaped", "terrain: gaped; allowed: blocks, flat, gapped, mixed; closest: gapped"),
        ("terrain=null", "terrain: None; allowed: blocks, flat, gapped, mixed"),
        ("terrain=[flat]", "terrain: .*; allowed: blocks, flat, gapped, mixed"),
        ("experiment=man", "experiment: man; allowed: main; closest: main"),
        ("seed", "missing EQUAL"),
        ("hydra.run.dri=x", r"hydra\.run\.dri"),
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
        ["experiment=main", "training.num_envs=8"],
        ["terrain.height_range=[0.15,0.45]"],
        ["-m", "seed=range(5)", "algo=ppo,sac"],
        ["hydra.run.dir=elsewhere"],
        ["--cfg", "job"],
    ],
)
def test_what_is_fine(arguments):
    check_arguments("train", arguments)


def test_keys_of_a_choice_that_was_not_made():
    with pytest.raises(UsageError, match=r"algo\.tau: no such key"):
        check_arguments("train", ["algo.tau=0.01"])


def test_choices_of_a_sweep():
    with pytest.raises(UsageError, match="algo: pp0; allowed: ppo, sac; closest: ppo"):
        check_arguments("train", ["-m", "algo=sac,pp0"])


def test_closest():
    assert closest("gapped_", ["flat", "gapped", "blocks"]) == "gapped"
