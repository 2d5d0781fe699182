# PYTHON_ARGCOMPLETE_OK
"""flyrl: one command, with a subcommand for everything there is to do."""

from __future__ import annotations

import argparse
import importlib
import os
import re
import sys
import time
from collections.abc import Iterable, Sequence
from typing import Any, Final, cast

from flyrl.cli import figures, play, reproduce, runs, tune, walk
from flyrl.cli.terminal import UNUSABLE, Ended, reported
from flyrl.resources import assets_folder, version

_SUBCOMMANDS: Final = (play, walk, figures, runs, reproduce, tune)
"""Modules with `add_to(subparsers)`, which names the function that runs the subcommand. None loads
anything heavy when it is imported."""

COMPOSED: Final = {
    "train": "train a policy, and film it",
    "evaluate": "compare policies and controllers in a report",
}
"""Subcommands whose arguments are Hydra's, and what each does."""

_EXAMPLES: Final = """examples:
  flyrl train task=target terrain=flat algo=ppo seed=0
  flyrl evaluate policies=[target-flat] controllers=[cpg,hybrid]
  flyrl play
  flyrl walk --controller cpg --video walk.mp4 --csv walk.csv
  flyrl figures cpg_tripod
  flyrl runs --sort best --reverse
  flyrl reproduce runs/2026-01-31_120000_target_flat_ppo_0

exit status:
  0 done; 1 done, but something was left out or came to something else; 2 the command line, or a
  file that it names, cannot be used; 128 + the signal's number after an interruption (Ctrl-C: 130)

flyrl <command> --help says what each takes; docs/cli.md says all."""


class _Version(argparse.Action):
    """Prints the version, which is looked up then: that takes longer than all else here."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(f"flyrl {version('flyrl') or '(not installed: run from a copy of its code)'}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a subcommand.

    Parameters
    ----------
    arguments
        Without the program; None takes those of the command line.

    Returns
    -------
    The exit status, as in docs/cli.md, or 128 and the number of a signal.

    Raises
    ------
    SystemExit
        With status 2, for an invalid command line; or as `train` and `evaluate` end.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if "_ARGCOMPLETE" in os.environ:
        import argcomplete  # noqa: PLC0415

        argcomplete.autocomplete(command_parsers()[0], default_completer=cast(Any, offered))
    try:
        with reported():
            if given and given[0] in COMPOSED:
                sys.argv = [sys.argv[0], *given[1:]]  # where Hydra reads them
                importlib.import_module(f"flyrl.cli.{given[0]}").main(subcommand=(given[0],))
                return 0
            options = _parsed(given)
            status: int = options.run(options)
    except Ended as end:
        return end.code if isinstance(end.code, int) else UNUSABLE
    return status


def command_parsers() -> tuple[argparse.ArgumentParser, dict[str, argparse.ArgumentParser]]:
    """Make the parser of the whole command, and those of the subcommands by name.

    That of `train` and `evaluate` only stands for them: their arguments are Hydra's.
    """
    parser = argparse.ArgumentParser(
        prog="flyrl",
        description="Train policies that steer a simulated fly, compare and play with them; look "
        "at runs,\nrepeat and tune them; draw figures.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=_EXAMPLES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    subparsers = parser.add_subparsers(
        title="commands", metavar="command [options]", required=True, dest="command"
    )
    for name, about in COMPOSED.items():  # listed and completed, never parsed
        composed = subparsers.add_parser(name, help=about, add_help=False)
        composed.add_argument("overrides", nargs=argparse.REMAINDER, metavar="KEY=VALUE")
    for module in _SUBCOMMANDS:
        module.add_to(subparsers)
    subparsers.add_parser(
        "compile",
        help="compile the controllers now, instead of at the first start",
        description="Compile the controllers, unless that is done, and print where they are kept: "
        "in __pycache__ beside the sources, or in the folder NUMBA_CACHE_DIR.",
    ).set_defaults(run=_compile)
    return parser, dict(subparsers.choices)


def _compile(options: argparse.Namespace) -> int:
    """Print the time that it took, and the folders."""
    from flyrl.simulation.callback import cache_folders  # noqa: PLC0415
    from flyrl.simulation.fly_scene import compile_controllers  # noqa: PLC0415

    start = time.perf_counter()
    compile_controllers()
    print(f"controllers ready after {time.perf_counter() - start:.1f} s")
    print(*(f"cache: {folder}" for folder in cache_folders()), sep="\n")
    return 0


def _parsed(given: Sequence[str]) -> argparse.Namespace:
    """Parse; name the closest match of a command or an option that does not exist."""
    from flyrl.validation import did_you_mean  # noqa: PLC0415  (loads NumPy)

    parser, commands = command_parsers()
    if given and not given[0].startswith("-") and given[0] not in commands:
        parser.error(
            f"there is no command {given[0]!r}{did_you_mean(given[0], commands)} "
            f"(commands: {', '.join(commands)})"
        )
    options, unknown = parser.parse_known_args(given)
    if unknown:
        command = commands[options.command]
        first = unknown[0].partition("=")[0]
        known = re.findall(r"--[\w-]+", command.format_help())
        command.error(f"unrecognized arguments: {' '.join(unknown)}{did_you_mean(first, known)}")
    return options


def offered(
    prefix: str, action: argparse.Action, parser: argparse.ArgumentParser, **_: Any
) -> Iterable[str]:
    """Values of an argument without choices of its own, or else files, as argcomplete asks.

    Its command, `register-python-argcomplete flyrl`, makes the shell ask; Hydra itself completes
    the settings of `train.py` and `evaluate.py`.
    """
    from argcomplete.completers import FilesCompleter  # noqa: PLC0415

    command = parser.prog.rpartition(" ")[2]
    if (command, action.dest) == ("figures", "names"):
        return figures.FIGURES
    if (command, action.dest) == ("play", "name"):
        return play.NAMES
    if action.dest == "policy":
        names = [file.stem for file in (assets_folder() / "policies").glob("*.safetensors")]
        return [*names, *FilesCompleter()(prefix)]
    from flyrl.cli.groups import groups  # noqa: PLC0415

    return groups().get(action.dest, ()) or FilesCompleter()(prefix)
