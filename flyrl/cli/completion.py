"""flyrl completion: the shell completes commands, options, names and folders.

Hydra itself completes the settings of `train.py` and `evaluate.py`.
"""

from __future__ import annotations

import argparse
import functools
import importlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Final, cast

from flyrl.cli.terminal import Subparsers

SHELLS: Final = ("bash", "zsh", "fish")

_TABLES: Final = {
    "body": "flyrl.envs.config:BODIES",
    "controller": "flyrl.controllers:CONTROLLERS",
    "physics": "flyrl.simulation.physics:PHYSICS_PRESETS",
    "task": "flyrl.tasks:TASKS",
    "terrain": "flyrl.terrains:TERRAINS",
}

Offer = dict[str, str]
"""What can stand there, and a word about each."""


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "completion",
        help="print what makes a shell complete flyrl's command lines",
        description="Print code that makes the shell complete commands, options, names "
        "and run folders.",
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


def answer(parser: argparse.ArgumentParser) -> None:
    """Tell the shell what can stand at its cursor, and end the process."""
    import argcomplete  # noqa: PLC0415

    argcomplete.autocomplete(parser, default_completer=cast(Any, offered))


def offered(
    prefix: str, action: argparse.Action, parser: argparse.ArgumentParser, **_: Any
) -> Iterable[str]:
    """Values of an argument without choices of its own, or else files, as argcomplete asks."""
    from argcomplete.completers import FilesCompleter  # noqa: PLC0415

    offer = _offer(parser.prog.rpartition(" ")[2], action.dest)
    if offer is not None:
        return offer(prefix=prefix)
    files: Iterable[str] = FilesCompleter()(prefix)
    return files


def _offer(command: str, argument: str) -> Callable[..., Offer] | None:
    """What offers the values of an argument of a subcommand, if anything does."""
    from flyrl.cli.figures import FIGURES  # noqa: PLC0415
    from flyrl.cli.play import NAMES  # noqa: PLC0415

    by_both: dict[tuple[str, str], Callable[..., Offer]] = {
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
            for group in ("body", "controller", "physics", "search", "task", "terrain")
        },
    }
    return by_both.get((command, argument)) or by_argument.get(argument)


def choices(group: str, prefix: str = "", **_: Any) -> Offer:
    """Names of a group: those of a table of flyrl's, or of the files in `configs/`."""
    from flyrl.resources import configs_folder  # noqa: PLC0415

    if group not in _TABLES:
        return {file.stem: "" for file in sorted((configs_folder() / group).glob("*.yaml"))}
    module, table = _TABLES[group].split(":")
    return {str(each): "" for each in getattr(importlib.import_module(module), table)}


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
