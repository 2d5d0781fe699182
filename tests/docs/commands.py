"""Command lines in the documentation, and how each is run or checked."""

import importlib.util
import json
import re
import shlex
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser

from flyrl.cli.arguments import check_arguments
from flyrl.cli.config import evaluation_settings, training_config
from flyrl.cli.evaluate import comparison
from flyrl.cli.groups import composed as composed_values
from flyrl.cli.main import command_parsers
from flyrl.evaluation import Results, evaluate
from flyrl.policies import named_policies
from flyrl.training.learn import Run, train
from tests.docs.pages import PAGES, ROOT, SHELLS, blocks

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
    "sed": "gets what pip says, which is not run",
    "uv": "another project's program, which asks the package index",
    "grep": "gets what uv says",
}
"""Program or module -> why its commands are neither run nor checked."""

COMPOSED = ("train", "evaluate")
"""Programs whose arguments are Hydra's."""

NEEDS_MORE = {"resume", "launcher", "hydra.sweep.dir", "logger"}
"""Keys of commands that go on with what is there, run elsewhere, or speak to a service; tests/cli
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


def commands(page: str) -> Iterator[tuple[str, bool]]:
    """Commands of a page: those in its blocks, and those in its text, which may be cut short."""
    for block in blocks(page, *SHELLS):
        for line in lines(block.parsed):
            yield line, True
    for inline in _INLINE.findall(PAGES[page].read_text()):
        if "…" not in inline and not inline.endswith((".", "=")):  # these are yet to be completed
            yield inline, False


def lines(block: str) -> Iterator[str]:
    """The commands of a block, without comments; what is piped or chained, one by one."""
    for line in block.replace("\\\n", " ").splitlines():
        told = re.sub(r"(^|\s)#.*", "", line).strip()
        told = re.sub(r"\s>>? \S+$", "", told)  # where the output goes
        yield from (part for part in re.split(r"\s(?:&&|\|)\s", told) if part)


def words(command: str) -> list[str]:
    """Program and arguments, with something in place of the placeholders.

    `train.py`, `flyrl train` and `python train.py` are all `train`.
    """
    for placeholder, word in PLACEHOLDERS.items():
        command = command.replace(placeholder, word)
    found = shlex.split(re.sub(r"<[^<>]+>", "somewhere", command))
    while re.fullmatch(r"[A-Z_]+=.*", found[0]):  # set for this command alone
        del found[0]
    found[0] = found[0].rpartition("bin/")[2]
    if found[0] in ("python", "python3"):
        del found[0]
    if found[0] == "-m":
        del found[0]
    if found[0] == "flyrl" and len(found) > 1 and found[1] in COMPOSED:
        del found[0]
    found[0] = found[0].removesuffix(".py") if found[0][:-3] in COMPOSED else found[0]
    return found


def composed(program: str) -> dict[tuple[str, ...], tuple[str, str]]:
    """Different overrides of a program on all pages: page and command that has them first.

    Seeds make no difference, but are parsed.
    """
    found: dict[tuple[str, ...], tuple[str, str]] = {}
    for page in PAGES:
        for command, _ in commands(page):
            name, *arguments = words(command)
            if name == program:
                overrides = [each for each in arguments if "=" in each]
                OverridesParser.create().parse_overrides(overrides)
                lasting = tuple(each for each in overrides if not each.startswith("seed="))
                found.setdefault(lasting, (page, command))
    return found


def trained(
    command: str, overrides: tuple[str, ...], folder: Path, before: dict[str, Run]
) -> Run | None:
    """Train as the command does, but for `SHORT` and `COARSE`; of a sweep, its first run.

    Parameters
    ----------
    command, overrides
        The same.
    folder
        Where the run gets its own.
    before
        Runs by their settings; one with the same settings is not repeated, a new one is added.

    Returns
    -------
    None if it is not trained, since it needs more than is there; then its arguments are checked.
    """
    keys = {each.partition("=")[0] for each in overrides}
    if keys & NEEDS_MORE:
        check_arguments("train", words(command)[1:])
        return None
    single = [re.sub(r"^([\w.]+=[\w-]+)(,[\w-]+)+$", r"\1", each) for each in overrides]
    values = _values("train", [*single, *SHORT])
    values["training"] |= SHORT_TRAINING
    if values["training"]["teacher"]:
        values["training"]["demonstrations"] = 32
    values["algo"] |= {key: SHORT_LEARNING[key] for key in SHORT_LEARNING.keys() & values["algo"]}
    settings = json.dumps(values, sort_keys=True)
    if settings not in before:
        before[settings] = train(training_config(values), folder)
    return before[settings]


def evaluated(overrides: tuple[str, ...], learned: Path) -> Results:
    """Evaluate as the command does, but for `SHORT` and `COARSE`: one terrain, one value of each.

    Parameters
    ----------
    overrides
        Of the command.
    learned
        Stands for policies that do not come with flyrl.
    """
    record = _values("evaluate", [*overrides, *SHORT, *SHORT_EVALUATION])
    settings = evaluation_settings(record)
    known = named_policies()
    policies = [name if name in known else str(learned) for name in settings["policies"]]
    vary = settings["vary"]
    one_each = vary and {name: values[-1:] for name, values in vary.items()}
    terrains = settings["terrains"][-1:]
    given = {**settings, "policies": policies, "vary": one_each, "terrains": terrains}
    config, entrants = comparison(record, given, ())
    return evaluate(config, entrants=entrants)


def _values(program: str, overrides: Sequence[str]) -> dict[str, Any]:
    is_coarse = not any(each.startswith(("physics=", "task=worm")) for each in overrides)
    chosen = [*overrides, *COARSE] if is_coarse else overrides
    return composed_values(program, chosen)


def check(command: str, *, is_whole: bool = True) -> None:
    """Check a command of another program; raise what is wrong with it."""
    program, *arguments = words(command)
    if program in NOT_CHECKED or program in COMPOSED:
        return
    if program.startswith("benchmarks"):
        found = importlib.util.find_spec(program)
        assert found is not None, program
        is_package = found.submodule_search_locations
        assert not is_package or importlib.util.find_spec(f"{program}.__main__"), program
    elif Path(program).parts[0] in ("tools", ".ci"):
        assert (ROOT / program).exists(), program
    else:
        assert program in _CHECKS, f"no check for {command!r}: add one, or a reason to NOT_CHECKED"
        _CHECKS[program](arguments, is_whole)


def _flyrl(arguments: list[str], is_whole: bool) -> None:
    """As flyrl parses them; of a command that is cut short, its name."""
    try:
        command_parsers()[0].parse_args(arguments if is_whole else [arguments[0], "--help"])
    except SystemExit as end:
        assert end.code == 0, arguments


def _make(arguments: list[str], is_whole: bool) -> None:
    """The targets are in the Makefile."""
    del is_whole
    makefile = (ROOT / "Makefile").read_text()
    for target in (each for each in arguments if "=" not in each):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def _pip(arguments: list[str], is_whole: bool) -> None:
    """The extras are in pyproject.toml. Nothing is installed."""
    del is_whole
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for extras in re.findall(r"\.\[([\w,]+)\]", " ".join(arguments)):
        assert set(extras.split(",")) <= set(project["optional-dependencies"]), extras


def _echo(arguments: list[str], is_whole: bool) -> None:
    """What is written into a shell's own file calls flyrl as can be."""
    (inner,) = re.findall(r"\$\(flyrl ([^)]*)\)", " ".join(arguments))
    _flyrl(shlex.split(inner), is_whole)


_CHECKS: dict[str, Callable[[list[str], bool], None]] = {
    "echo": _echo,
    "flyrl": _flyrl,
    "make": _make,
    "pip": _pip,
}
