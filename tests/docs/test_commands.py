"""Every command in the documentation is one that its program takes.

Trainings and evaluations run, with few decisions and episodes; of a sweep its first run, of what is
varied one value each, of terrains one. So does what is said to fail. Figures, lists of runs, pages
and tools have tests of their own; here their commands are handed to the checks that programs make
before they begin to work. What is not even that, `NOT_CHECKED` gives the reason for.
"""

import importlib.util
import itertools
import json
import re
import shlex
import sys
import tomllib
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from flyrl.cli import evaluate as evaluate_command
from flyrl.cli import train as train_command
from flyrl.cli.arguments import check_arguments
from flyrl.cli.arguments import composed as composed_values
from flyrl.cli.config import evaluation_settings, training_config
from flyrl.cli.evaluate import comparison
from flyrl.cli.main import command_parsers
from flyrl.evaluation import evaluate
from flyrl.policies import named_policies
from flyrl.training.learn import train
from flyrl.training.runs import read_run
from tests.docs.pages import PAGES, ROOT, SHELLS, blocks, language_of

PLACEHOLDERS = {
    "<task>": "target",
    "<algorithm>": "ppo",
    "<name>": "target-flat",
    "<server>": "localhost",
}
"""What stands for a word; any other <words> stand for the path of a file or a folder."""

NOT_CHECKED = {
    "ray": "another project's program, which starts a cluster",
    "rl_zoo3.train": "another project's program; tests/clients/test_rl_zoo.py runs it",
    "rl_zoo3.enjoy": "the same",
    "venv": "Python's own; makes an environment in which pip would download",
    "uv": "another project's program, which asks the package index",
    "sed": "edits what uv wrote",
}
"""Program or module -> why its commands are neither run nor checked."""

COMPOSED = {"train": train_command.main, "evaluate": evaluate_command.main}
"""Programs whose arguments are Hydra's."""

NEEDS_MORE = {"resume", "launcher", "hydra.sweep.dir", "logger"}
"""Keys of commands that resume what is there, run elsewhere, or speak to a service; tests/cli
and tests/training/loggers run such."""

SHORT = ("task.time_limit=0.1",)
COARSE = ("physics=fast",)
"""For flies, where a command does not ask for other physics."""

SHORT_TRAINING = {
    "total_timesteps": 32,
    "num_envs": 2,
    "num_threads": 1,
    "evaluation_interval": 32,
    "evaluation_episodes": 1,
    "checkpoint_interval": 32,
    "progress_bar": False,
}
SHORT_LEARNING = {
    "n_steps": 16,
    "n_epochs": 1,
    "batch_size": 16,
    "learning_starts": 20,
    "gradient_steps": 1,
    "buffer_size": 1000,
}
"""Those that the algorithm has."""

SHORT_EVALUATION = ("episodes=1", "num_threads=1", "progress_bar=false", "film=[0]", "seed=0")

_INLINE = re.compile(
    r"`((?:[A-Z_]+=\S+ )?(?:python )?(?:train|evaluate)\.py [^`\n]+|flyrl \w[^`\n]*)`"
)


def commands(page):
    """Commands of a page: those in its blocks, and those in its text, which may be cut short."""
    for block in blocks(page, *SHELLS):
        for line in lines(block.parsed):
            yield line, True
    for inline in _INLINE.findall(PAGES[page].read_text()):
        if "…" not in inline and not inline.endswith((".", "=")):  # these are yet to be completed
            yield inline, False


def lines(block):
    """The commands of a block, without comments; what is piped or chained, one by one."""
    for line in block.replace("\\\n", " ").splitlines():
        told = re.sub(r"(^|\s)#.*", "", line).strip()
        told = re.sub(r"\s>>? \S+$", "", told)  # where the output goes
        yield from (part for part in re.split(r"\s(?:&&|\|)\s", told) if part)


def words(command):
    """Program and arguments, with something in place of the placeholders.

    `train.py`, `flyrl train` and `python train.py` are all `train`.
    """
    for placeholder, word in PLACEHOLDERS.items():
        command = command.replace(placeholder, word)
    command = re.sub(r"^([A-Z_]+=\S+ )?((\S*bin/)?python3? )?(-m )?", "", command)
    command = re.sub(r"^(flyrl (?=train|evaluate)|\S*bin/)", "", command)
    program, *arguments = shlex.split(re.sub(r"<[^<>]+>", "somewhere", command))
    return [re.sub(r"^(train|evaluate)\.py$", r"\1", program), *arguments]


def composed(program):
    """Different overrides of a program on all pages: page and command that has them first.

    Seeds make no difference, but are parsed. Commands that are said to fail are left out.
    """
    found = {}
    for page in PAGES:
        for command, _ in commands(page):
            name, *arguments = words(command)
            if name == program and command not in FAILING:
                overrides = [each for each in arguments if "=" in each]
                OverridesParser.create().parse_overrides(overrides)
                lasting = tuple(each for each in overrides if not each.startswith("seed="))
                found.setdefault(lasting, (page, command))
    return found


def trained(overrides, folder, before):
    """Train with overrides, but for `SHORT` and `COARSE`; of a sweep, its first run.

    Parameters
    ----------
    folder
        Where the run gets its own.
    before
        Runs by their settings; one with the same settings is not repeated, a new one is added.
    """
    single = [re.sub(r"^([\w.]+=[\w-]+)(,[\w-]+)+$", r"\1", each) for each in overrides]
    values = short_values("train", [*single, *SHORT])
    values["training"] |= SHORT_TRAINING
    if values["training"]["teacher"]:
        values["training"]["demonstrations"] = 32
    values["algo"] |= {key: SHORT_LEARNING[key] for key in SHORT_LEARNING.keys() & values["algo"]}
    settings = json.dumps(values, sort_keys=True)
    if settings not in before:
        before[settings] = train(training_config(values), folder)
    return before[settings]


def evaluated(overrides, learned):
    """Evaluate with overrides, but for `SHORT` and `COARSE`: one terrain, one value of each.

    `learned` has folders of runs by their task and `_terms`; the one that fits stands for policies
    that do not come with flyrl.
    """
    record = short_values("evaluate", [*overrides, *SHORT, *SHORT_EVALUATION])
    settings = evaluation_settings(record)
    known = named_policies()
    run = learned.get((record["task"]["name"], *_terms(overrides)))
    policies = [name if name in known else str(run) for name in settings["policies"]]
    vary = settings["vary"]
    one_each = vary and {name: values[-1:] for name, values in vary.items()}
    terrains = settings["terrains"][-1:]
    given = {**settings, "policies": policies, "vary": one_each, "terrains": terrains}
    config, entrants = comparison(record, given, ())
    return evaluate(config, entrants=entrants)


def short_values(program, overrides):
    is_coarse = not any(each.startswith(("physics=", "task=worm")) for each in overrides)
    chosen = [*overrides, *COARSE] if is_coarse else overrides
    return composed_values(program, chosen)


def check(command, *, is_whole=True):
    """Check a command of another program; raise what is wrong with it.

    Of one that is cut short, flyrl's parser sees the name. Nothing is installed.
    """
    program, *arguments = words(command)
    text = " ".join(arguments)
    if program in NOT_CHECKED or program in COMPOSED:
        return
    if program.startswith("benchmarks"):
        is_file = program.endswith(".py")
        assert (ROOT / program).exists() if is_file else importlib.util.find_spec(program), program
    elif Path(program).parts[0] in ("tools", ".ci"):
        assert (ROOT / program).exists(), program
    elif program == "make":
        for target in (each for each in arguments if "=" not in each):
            assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE), target
    elif program == "pip":
        project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        for extras in re.findall(r"\.\[([\w,]+)\]", text):
            assert set(extras.split(",")) <= set(project["optional-dependencies"]), extras
    elif program == "echo":  # of what is written into a shell's own file
        check("flyrl " + re.search(r"\$\(flyrl ([^)]*)\)", text)[1])
    else:
        assert program == "flyrl", f"no check for {command!r}: add one, or a reason to NOT_CHECKED"
        try:
            command_parsers()[0].parse_args(arguments if is_whole else [arguments[0], "--help"])
        except SystemExit as end:
            assert end.code == 0, arguments


def _failing():
    """Commands that are followed by the error that they end with."""
    for page in PAGES:
        examples = blocks(page, "bash", "text")
        for block, after in itertools.pairwise(examples):
            is_pair = (language_of(block), language_of(after)) == ("bash", "text")
            if is_pair and after.parsed.startswith("error: "):
                (command,) = lines(block.parsed)
                yield command, after.parsed.strip()


def _terms(overrides):
    """Terms of its own that a training or an evaluation asks for."""
    return tuple(each for each in overrides if each.startswith(("task.terms=", "task.without=")))


FAILING = dict(_failing())


@pytest.mark.slow
def test_every_training_runs_and_every_evaluation_too(folder_of, subtests, monkeypatch):
    monkeypatch.setattr("flyrl.training.imitation._UPDATES", 20)
    folder_of("docs/controllers.md")
    folder = folder_of("docs/tasks.md")
    before, learned = {}, {}
    for overrides, (page, command) in composed("train").items():
        with subtests.test(f"{page}: {command}"):
            if {each.partition("=")[0] for each in overrides} & NEEDS_MORE:
                check_arguments("train", words(command)[1:])
                continue
            run = trained(overrides, folder / "runs", before)
            assert (run.folder / "last.safetensors").exists()
            task = read_run(run.folder).settings["task"]["name"]
            learned[task, *_terms(overrides)] = run.folder
    for overrides, (page, command) in composed("evaluate").items():
        with subtests.test(f"{page}: {command}"):
            assert not evaluated(overrides, learned).protocol["crashes"]


@pytest.mark.parametrize("page", PAGES)
def test_other_commands_are_accepted(page):
    for command, is_whole in commands(page):
        check(command, is_whole=is_whole)


@pytest.mark.parametrize("command", FAILING)
def test_a_command_that_is_said_to_fail_says_so(command, folder_of, monkeypatch, capsys):
    (folder_of("docs/troubleshooting.md") / "model.zip").touch()
    program, *arguments = words(command)
    monkeypatch.setattr(sys, "argv", [f"{program}.py", *arguments])
    with pytest.raises(SystemExit) as end:
        COMPOSED[program]()
    assert end.value.code == 2
    expected = ".*".join(re.escape(part) for part in FAILING[command].split("…"))
    assert re.search(expected, capsys.readouterr().err, re.DOTALL)


@pytest.mark.parametrize(
    "command", ["flyrl run", "make tset", "pip install -e '.[slum]'", "cat runs"]
)
def test_a_wrong_command_is_found(command):
    with pytest.raises(AssertionError):
        check(command)
