import math

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from flyrl.cli.config import training_config
from flyrl.cli.search_space import (
    Choices,
    Range,
    check_space,
    find_space,
    override_text,
    read_space,
    search_space,
    with_values,
)
from flyrl.cli.tune import compose_training
from flyrl.resources import configs_folder

SETTINGS = {
    "algo": {"learning_rate": 1e-3, "n_epochs": 10, "hidden_layers": [64], "clip": None},
    "training": {"num_envs": 2, "evaluation_episodes": 4},
    "seed": 0,
}


@pytest.mark.parametrize(
    ("key", "given", "said"),
    [
        ("algo.learning_rat", {"low": 0, "high": 1}, "did you mean 'algo.learning_rate'"),
        ("algo", {"choices": ["ppo", "sac"]}, "algo is a group"),
        ("seed", {"low": 0, "high": 9}, "seed cannot be searched"),
        ("training.evaluation_episodes", {"low": 1, "high": 9}, "not be comparable"),
        ("algo.learning_rate", 1e-3, "must be {low, high} or {choices}, got 0.001"),
        ("algo.learning_rate", {"low": 1e-3}, "must have low and high"),
        ("algo.learning_rate", {"low": 0.1, "hihg": 1}, "hihg"),
        ("algo.learning_rate", {"low": 1e-3, "high": 1e-3}, "low must be below its high, 0.001"),
        ("algo.learning_rate", {"low": "1", "high": 2}, "low must be a number, got '1'"),
        ("algo.learning_rate", {"low": 1, "high": math.inf}, "high must be finite"),
        ("algo.learning_rate", {"low": 0, "high": 1, "log": True}, "low must be above 0"),
        ("algo.learning_rate", {"low": 1, "high": 2, "log": 1}, "log must be true or false"),
        ("algo.learning_rate", {"low": 0, "high": 1, "step": 0.3}, "must lead from 0.0 to 1.0"),
        ("algo.learning_rate", {"low": 0, "high": 1, "step": -1}, "step must be above 0"),
        ("algo.learning_rate", {"low": 1, "high": 2, "step": 1, "log": True}, "either log"),
        ("algo.n_epochs", {"low": 1.5, "high": 3}, "is a whole number"),
        ("algo.n_epochs", {"choices": [1]}, "list of two or more"),
        ("algo.n_epochs", {"choices": [1, 2], "low": 1}, "takes no 'low'"),
        ("algo.n_epochs", {"choices": [1, 2, 1]}, "got 1 twice"),
        ("algo.n_epochs", {"choices": [1, {"a": 2}]}, "numbers, text or lists"),
    ],
)
def test_a_space_that_cannot_be_meant_so(key, given, said):
    with pytest.raises(ValueError) as error:
        search_space({key: given}, SETTINGS, "mine.yaml")
    assert str(error.value).startswith("mine.yaml: ")
    assert said in str(error.value)


def test_a_file_with_aliases_is_refused(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("a: &a {low: 1, high: 2}\nb: *a\n")
    with pytest.raises(ValueError, match=r"mine\.yaml.*aliases \(\*name\) are not allowed"):
        read_space(file)


def test_a_whole_setting_has_whole_numbers_and_another_has_all():
    written = {
        "algo.n_epochs": {"low": 1, "high": 3},
        "algo.learning_rate": {"low": 1, "high": 3},
        "algo.clip": {"low": 0, "high": 0.5},
    }
    space = search_space(written, SETTINGS, "mine.yaml")
    assert [space[key].is_whole for key in written] == [True, False, False]


@pytest.mark.parametrize("text", ["", "- a", "a: [", "a: 1\na: 2", "1"])
def test_a_file_that_holds_no_space(text, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"mine\.yaml"):
        read_space(path)


def test_a_number_in_scientific_notation_is_a_number(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("algo.learning_rate: {low: 1e-4, high: 3e-3, log: true}")
    space = search_space(read_space(path), SETTINGS, "mine.yaml")
    assert space == {"algo.learning_rate": Range(1e-4, 3e-3, None, True)}


def test_a_space_is_found_by_algorithm_name_or_path(tmp_path):
    folder = configs_folder() / "search"
    assert find_space(None, "sac") == folder / "sac.yaml"
    assert find_space("ppo", "sac") == folder / "ppo.yaml"
    with pytest.raises(ValueError, match="algo=ddpg"):
        find_space(None, "ddpg")
    with pytest.raises(ValueError, match="ppo"):
        find_space("pop", "sac")
    with pytest.raises(ValueError, match="no file"):
        find_space(str(tmp_path / "missing.yaml"), "sac")


@pytest.mark.parametrize("algo", [path.stem for path in (configs_folder() / "search").glob("*")])
def test_shipped_spaces_are_possible(algo):
    settings = compose_training([f"algo={algo}"])
    space = search_space(read_space(find_space(None, algo)), settings, algo)
    check_space(space, lambda values: training_config(with_values(settings, values)), algo)


def test_two_values_that_do_not_go_together_are_found():
    space = {"a": Range(1, 4), "b": Choices((1, 2, 3)), "c": Range(0.0, 1.0)}

    def check(values):
        if values["a"] == 4 and values["b"] == 3:
            raise ValueError("b must divide a")

    with pytest.raises(ValueError, match=r"mine allows a=4 b=3, but b must divide a"):
        check_space(space, check, "mine")


def test_only_what_can_be_drawn_is_tried():
    tried = []
    check_space({"a": Range(1, 4), "b": Choices((5, 6))}, tried.append, "mine")
    assert {(values["a"], values["b"]) for values in tried} == {(1, 5), (4, 5), (1, 6), (4, 6)}


def test_values_are_set_without_touching_the_settings():
    changed = with_values(SETTINGS, {"algo.n_epochs": 3, "seed": 4})
    assert (changed["algo"]["n_epochs"], changed["seed"]) == (3, 4)
    assert (SETTINGS["algo"]["n_epochs"], SETTINGS["seed"]) == (10, 0)


@pytest.mark.parametrize(
    "value",
    [
        None,
        True,
        7,
        -3,
        1e-05,
        0.1 + 0.2,
        1e22,
        "tanh",
        "null",
        "nan",
        "1",
        "",
        "it's",
        "a b,c=d",
        "x\\",
        "x\\'y",
        "${seed}",
        [64, 64],
        ["a b", [1.5, None]],
    ],
)
def test_hydra_reads_the_value_that_was_written(value):
    (override,) = OverridesParser.create().parse_overrides([f"key={override_text(value)}"])
    read = override.value()

    def plain(item):
        if isinstance(item, list):
            return [plain(one) for one in item]
        return item.text if hasattr(item, "text") else item

    assert plain(read) == value
    assert type(plain(read)) is type(value)
