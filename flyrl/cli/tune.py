"""flyrl tune: search for the best settings with Optuna; the trials are ordinary runs.

The folder of a study holds

- `study.json`: what is searched, the settings of all trials, and the commands;
- `study.db`: Optuna's storage (SQLite): every trial, its values, evaluations and end;
- the run folders of the trials;
- `study.csv`, a line per trial, and the plots.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.util
import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.cli.program import Subparsers
from flyrl.files import new_folder, write_text
from flyrl.resources import install_command

if TYPE_CHECKING:
    from flyrl.cli.study import Plan

STUDY_FILE: Final = "study.json"


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "tune",
        help="search for the best settings with Optuna",
        description="Train again and again with settings that Optuna draws from a search space, "
        "and end those early that fall behind. The same command with the same name continues "
        "a study; more trials make it longer.",
        epilog="What is maximised: the best success rate on the held-out episodes; of equal ones, "
        "that with the higher return. Exit status: 0, 1 if no trial came to its end, 2 for an "
        "error, 128 + the signal's number after an interruption. Example: flyrl tune --name target "
        "--trials 30 task=target algo=ppo training.total_decisions=20000",
    )
    parser.add_argument(
        "overrides", nargs="*", metavar="KEY=VALUE", help="settings of all trials, as of train.py"
    )
    parser.add_argument("--name", help="of the study (default: date and time)")
    parser.add_argument("--trials", type=int, default=50, help="in all (default: 50)")
    parser.add_argument(
        "--search",
        metavar="SPACE",
        help="a file of configs/search, or a YAML file of your own (default: as the algorithm)",
    )
    parser.add_argument("--seed", type=int, default=0, help="of the search (default: 0)")
    parser.add_argument(
        "--prune-after",
        type=int,
        default=5,
        metavar="TRIALS",
        help="that came to their end, before others are ended early (default: 5)",
    )
    parser.add_argument("--no-pruning", action="store_true", help="let every trial come to its end")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Go on with a study, or start it."""
    from flyrl.validation import at_least  # noqa: PLC0415

    if importlib.util.find_spec("optuna") is None:
        raise ValueError(f"flyrl tune needs Optuna: {install_command('optuna')}")
    at_least("--trials", options.trials, 1)
    at_least("--seed", options.seed, 0)
    at_least("--prune-after", options.prune_after, 1)
    plan, written = _plan(options)
    # a mistake has been reported by now, without Optuna and torch
    from flyrl.cli.study import opened, search  # noqa: PLC0415
    from flyrl.cli.study_table import tell  # noqa: PLC0415
    from flyrl.training.interruption import interruption  # noqa: PLC0415
    from flyrl.training.runs import held  # noqa: PLC0415

    if options.name is None:
        folder = new_folder(plan.folder.parent, plan.folder.name)
        plan = replace(plan, folder=folder)
    plan.folder.mkdir(parents=True, exist_ok=True)
    prune_after = None if options.no_pruning else options.prune_after
    with held(plan.folder), interruption() as interrupted:
        _note(plan, written)
        with opened(plan, prune_after) as study:
            number = search(study, plan, interrupted)
            has_best = tell(study, plan, is_ended=number is None)
    if number is not None:
        print(f"interrupted; go on with the same command and --name {plan.folder.name}")
    print(f"study: {plan.folder}")
    return 128 + number if number is not None else int(not has_best)


def _plan(options: argparse.Namespace) -> tuple[Plan, dict[str, Any]]:
    """Check what was asked for; return it, and the search space as it was written."""
    from flyrl.cli.config import training_config  # noqa: PLC0415
    from flyrl.cli.search_space import (  # noqa: PLC0415
        check_space,
        find_space,
        read_space,
        search_space,
    )
    from flyrl.cli.study import Plan  # noqa: PLC0415
    from flyrl.cli.sweep import by_key  # noqa: PLC0415
    from flyrl.training.config import training_record  # noqa: PLC0415

    settings = compose_training(options.overrides)
    for key in ("resume", "evaluate_after"):
        if settings[key]:
            raise ValueError(f"flyrl tune only trains; {key} cannot be given with it")
    record = training_record(training_config(settings))
    path = find_space(options.search, record["algo"]["name"])
    written = read_space(path)
    space = search_space(written, {key: settings[key] for key in record}, str(path))
    for key in by_key(options.overrides):
        if key in space:
            print(f"{key} is searched: what is given for it is not taken", file=sys.stderr)
    name = options.name
    if name is None:
        name = datetime.datetime.now().astimezone().strftime("%Y-%m-%d_%H%M%S")
    elif name in {"", ".", ".."} or Path(name).name != name:
        raise ValueError(f"--name must be the name of a folder, got {name!r}")
    folder = Path(settings["runs_folder"]) / "studies" / name
    plan = Plan(folder, tuple(options.overrides), settings, space, options.trials, options.seed)
    check_space(space, plan.config, str(path))
    return plan, written


def compose_training(overrides: Sequence[str]) -> dict[str, Any]:
    """Settings that `train.py` would take with these overrides, as plain values.

    Raises
    ------
    ValueError
        An override that `train.py` refuses, or that asks for more than one run.
    """
    from flyrl.cli.arguments import check_arguments, with_own_things  # noqa: PLC0415
    from flyrl.cli.groups import composed  # noqa: PLC0415

    overrides = with_own_things(overrides)
    if (sweep := check_arguments("train", ["-m", *overrides])) and len(sweep.jobs) != 1:
        raise ValueError(
            "flyrl tune trains one after the other, and searches what the search space says; it "
            f"takes no sweep, got {' '.join(overrides)}"
        )
    return composed("train", overrides)


def _note(plan: Plan, written: Mapping[str, Any]) -> None:
    """Write down what the study is; raise ValueError if the one in its folder is another."""
    from flyrl.training.config import training_record  # noqa: PLC0415
    from flyrl.training.runs import flat  # noqa: PLC0415

    path = plan.folder / STUDY_FILE
    record = {
        "seed": plan.seed,
        "search": dict(written),
        "settings": training_record(plan.config({})),
    }
    commands: list[str] = []
    if path.exists():
        try:
            earlier = json.loads(path.read_text())
            commands = [str(command) for command in earlier["commands"]]
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path} cannot be read: {error}") from error
        before = flat({key: earlier.get(key) for key in record})
        now = flat(json.loads(json.dumps(record)))
        for key in dict.fromkeys([*before, *now]):
            if before.get(key) != now.get(key):
                raise ValueError(
                    f"{plan.folder} is a study with other settings: {key} is {before.get(key)}, "
                    f"now {now.get(key)}; take another --name"
                )
    elif any(plan.folder.glob("[!.]*")):
        raise ValueError(f"{plan.folder} holds something else than a study; take another --name")
    commands.append(shlex.join(["flyrl", *sys.argv[1:]]))
    write_text(path, json.dumps({"commands": commands, **record}, indent=2) + "\n")
