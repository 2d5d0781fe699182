import pytest

from flyrl.cli.arguments import UsageError, check_arguments, unknown_key


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
            "terrain must be one of 'blocks', .*, got 'gaped'; did you mean 'gapped'",
        ),
        ("terrain=null", "terrain must be one of .*, got None"),
        ("terrain=[flat]", "terrain must be one of .*, got .*flat"),
        ("experiment=man", "experiment must be one of 'main', got 'man'"),
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
        ["algo=recurrent_ppo", "algo.lstm_hidden_size=32", "algo.normalize_observation=true"],
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
    with pytest.raises(UsageError, match=r"there is no key 'algo\.tau'"):
        check_arguments("train", ["algo.tau=0.01"])


def test_choices_of_a_sweep():
    with pytest.raises(
        UsageError, match=r"algo must be one of 'a2c', .*, got 'pp0'; did you mean 'ppo'\?"
    ):
        check_arguments("train", ["-m", "algo=sac,pp0"])


def test_a_key_like_no_other_still_gets_a_suggestion():
    assert "did you mean 'seed'?" in str(unknown_key("x", ["seed"]))
