"""flyrl completion: the shell completes commands, options, settings, names and folders.

What is offered is read from folders and YAML files alone: nobody waits for MuJoCo at a prompt.
"""

from __future__ import annotations

import argparse
import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from flyrl.cli.program import Subparsers

SHELLS: Final = ("bash", "zsh", "fish")

Offer = dict[str, str]
"""What can stand there, and a word about each."""


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "completion",
        help="print what makes a shell complete flyrl's command lines",
        description="Print code that makes the shell complete commands, options, settings of "
        "train, evaluate and tune, names and run folders.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="once for every new shell:\n"
        """  bash: echo 'eval "$(flyrl completion bash)"' >> ~/.bashrc\n"""
        """  zsh:  echo 'eval "$(flyrl completion zsh)"' >> ~/.zshrc   (after compinit)\n"""
        "  fish: flyrl completion fish > ~/.config/fish/completions/flyrl.fish",
    )
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the shell's code."""
    from argcomplete.shell_integration import shellcode  # noqa: PLC0415

    print(shellcode(["flyrl"], shell=options.shell))
    return 0


def answer(
    parser: argparse.ArgumentParser, commands: Mapping[str, argparse.ArgumentParser]
) -> None:
    """Tell the shell what can stand at its cursor, and end the process."""
    import argcomplete  # noqa: PLC0415

    add_completers(commands)
    argcomplete.autocomplete(parser)


def add_completers(commands: Mapping[str, argparse.ArgumentParser]) -> None:
    """Tell argcomplete what the arguments of all subcommands can be, by their names."""
    for command, its_parser in commands.items():
        for action in its_parser._actions:
            offer = _offer(command, action.dest)
            if offer is not None and not action.choices:
                vars(action)["completer"] = offer


def _offer(command: str, argument: str) -> Callable[..., Offer] | None:
    """What offers the values of an argument of a subcommand, if anything does."""
    from flyrl.cli.figures import FIGURES  # noqa: PLC0415
    from flyrl.cli.play import NAMES  # noqa: PLC0415

    by_both: dict[tuple[str, str], Callable[..., Offer]] = {
        ("train", "overrides"): functools.partial(overrides, "train"),
        ("tune", "overrides"): functools.partial(overrides, "train"),
        ("evaluate", "overrides"): functools.partial(overrides, "evaluate"),
        ("figures", "names"): lambda **_: dict(FIGURES),
        ("play", "name"): lambda **_: dict.fromkeys(NAMES, ""),
        ("runs", "paths"): folders,
        ("sweep", "folders"): functools.partial(folders, below="sweeps"),
        ("reproduce", "original"): folders,
        ("reproduce", "repeat"): folders,
    }
    by_argument: dict[str, Callable[..., Offer]] = {
        "policy": policies,
        "presets": functools.partial(choices, "physics"),
        "terrains": functools.partial(choices, "terrain"),
        **{
            group: functools.partial(choices, group)
            for group in ("algo", "body", "controller", "physics", "search", "task", "terrain")
        },
    }
    return by_both.get((command, argument)) or by_argument.get(argument)


def choices(group: str, prefix: str = "", **_: Any) -> Offer:
    """Choices of a config group."""
    from flyrl.cli.groups import config_groups  # noqa: PLC0415

    return dict.fromkeys(config_groups().get(group, ()), "")


def policies(prefix: str, **_: Any) -> Offer:
    """Policies that come with flyrl, by name, and run folders."""
    from flyrl.resources import assets_folder  # noqa: PLC0415

    files = sorted((assets_folder() / "policies").glob("*.safetensors"))
    return {**{file.stem: "comes with flyrl" for file in files}, **folders(prefix)}


def folders(prefix: str, below: str = "", **_: Any) -> Offer:
    """Run folders, and the folders on the way to others.

    Parameters
    ----------
    prefix
        What is typed already.
    below
        A folder in `runs/` of which all folders are offered too.
    """
    from flyrl.training.runs import find_runs  # noqa: PLC0415

    near = Path(prefix.rpartition("/")[0] or ("/" if prefix.startswith("/") else "."))
    offer = {}
    if prefix and near.is_dir():
        offer = {
            f"{prefix.rpartition('/')[0]}/{entry.name}/" if "/" in prefix else f"{entry.name}/": ""
            for entry in near.iterdir()
            if entry.is_dir() and not entry.name.startswith(".")
        }
    looked_in = [Path("runs"), *([near] if near != Path() else [])]
    for folder in looked_in:
        if folder.is_dir():
            offer |= {str(run): "a run" for run in find_runs(folder) if f"{run}/" != prefix}
    if below and (Path("runs") / below).is_dir():
        offer |= {str(each): "" for each in (Path("runs") / below).iterdir() if each.is_dir()}
    for run in [each for each in offer if f"{each}/" in offer]:
        del offer[f"{run}/"]  # whole as it is: no slash to wait behind
    return offer


def overrides(config_name: str, prefix: str, parsed_args: argparse.Namespace, **_: Any) -> Offer:
    """Keys and values of Hydra's, of the settings that the line has chosen so far.

    Parameters
    ----------
    config_name
        Name of the primary config.
    prefix
        What is typed of the word.
    parsed_args
        Its `overrides` are the words before.
    """
    before = [str(word) for word in getattr(parsed_args, "overrides", None) or ()]
    if before and before[-1] in {"--cfg", "-c"}:
        return dict.fromkeys(("job", "hydra", "all"), "")
    plus = prefix[: len(prefix) - len(prefix.lstrip("+~"))]
    key, is_value, typed = prefix[len(plus) :].partition("=")
    groups, settings = _settings(config_name, before)
    if is_value:
        head = typed[: max(typed.rfind("["), typed.rfind(",")) + 1]
        offered = _values(key, groups, settings, typed[len(head) :])
        return {f"{plus}{key}={head}{value}": text for value, text in offered.items()}
    found: Iterable[str]
    if "." in key:
        group = key.partition(".")[0]
        found = (f"{group}.{each}=" for each in _leaves(settings.get(group)))
    else:
        whole = (f"{each}=" for each in sorted({*groups, *settings}))
        parts = (f"{each}." for each, value in settings.items() if isinstance(value, Mapping))
        found = [*whole, *parts]
    return {plus + each: "" for each in found}


def _values(key: str, groups: Iterable[str], settings: Mapping[str, Any], typed: str) -> Offer:
    if key in groups:
        return choices(key)
    if key.rpartition(".")[2] == "policies":
        return policies(typed)
    if key.rpartition(".")[2] == "terrains":
        return choices("terrain")
    if key == "resume":
        return folders(typed)
    value: Any = settings
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return {"true": "", "false": ""} if isinstance(value, bool) else {}


def _settings(config_name: str, words: Sequence[str]) -> tuple[list[str], dict[str, Any]]:
    """Groups of a config, and its settings as far as one file each tells them."""
    from flyrl.resources import configs_folder  # noqa: PLC0415

    chosen = dict(word.lstrip("+~").split("=", 1) for word in words if "=" in word)
    main = _yaml(configs_folder() / f"{config_name}.yaml")
    settings: dict[str, Any] = {}
    groups = []
    for entry in main.pop("defaults", ()):
        for group, choice in entry.items() if isinstance(entry, Mapping) else ():
            if " " in group:
                continue  # not for the user to choose
            name, _, package = group.partition("@")
            held = _yaml(configs_folder() / name / f"{chosen.get(group, choice)}.yaml")
            held.pop("defaults", None)
            if package:
                settings |= held
                continue
            groups.append(name)
            if name not in {"experiment", "launcher"}:  # these hold keys of others
                settings[name] = held
    main.pop("hydra", None)
    for key, value in main.items():
        is_more = isinstance(value, Mapping) and isinstance(settings.get(key), dict)
        settings[key] = {**settings[key], **value} if is_more else value
    return groups, settings


def _yaml(path: Path) -> dict[str, Any]:
    """What a file of settings holds; nothing if it is not there."""
    from flyrl.files import load_yaml  # noqa: PLC0415

    return dict(load_yaml(path) or {}) if path.is_file() else {}


def _leaves(value: Any) -> Iterator[str]:
    """Dotted keys below a setting."""
    for key, held in value.items() if isinstance(value, Mapping) else ():
        if isinstance(held, Mapping) and held:
            yield from (f"{key}.{each}" for each in _leaves(held))
        else:
            yield str(key)
