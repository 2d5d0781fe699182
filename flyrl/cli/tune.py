"""flyrl tune: search for the best settings with Optuna; the trials are ordinary runs."""

from __future__ import annotations

import argparse
import datetime
import importlib.util
import shlex
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from flyrl.cli.terminal import Subparsers
from flyrl.resources import configs_folder, install_command

if TYPE_CHECKING:
    from flyrl.front.study import Plan
    from flyrl.training.config import TrainingConfig

_SHOWN: Final = 10
"""Best trials that are listed."""


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
        "--trials 30 task=target algo=ppo training.total_timesteps=20000",
    )
    parser.add_argument(
        "overrides", nargs="*", metavar="KEY=VALUE", help="settings of all trials, as of train.py"
    )
    parser.add_argument("--name", help="of the study (default: date and time)")
    parser.add_argument("--trials", type=int, default=50, help="in all (default: 50)")
    parser.add_argument(
        "--search",
        metavar="FILE",
        help="a YAML file with a search space (default: configs/search/<algorithm>.yaml)",
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
    """Start or resume a study; print its best trials."""
    import pandas as pd  # noqa: PLC0415

    from flyrl.cli.terminal import print_table  # noqa: PLC0415
    from flyrl.validation import at_least  # noqa: PLC0415

    if importlib.util.find_spec("optuna") is None:
        raise ValueError(f"flyrl tune needs Optuna: {install_command('optuna')}")
    for key, least in (("trials", 1), ("seed", 0), ("prune_after", 1)):
        at_least(f"--{key.replace('_', '-')}", getattr(options, key), least)
    settings = compose_training(options.overrides)
    for key in ("resume", "evaluate_after"):
        if settings[key]:
            raise ValueError(f"flyrl tune only trains; {key} cannot be given with it")
    from flyrl.front.study import tune  # noqa: PLC0415

    plan = _plan(options, settings)
    trials, interrupted_by = tune(plan, shlex.join(["flyrl", *sys.argv[1:]]))
    done = [trial for trial in trials if trial.state.name == "COMPLETE"]
    best = sorted(done, key=lambda trial: -trial.values[0])[:_SHOWN]
    if best:
        rows = [
            {
                "number": trial.number,
                "value": trial.value,
                **plan.values(trial.params),
                "run": trial.user_attrs.get("run"),
            }
            for trial in best
        ]
        print_table(pd.DataFrame(rows, dtype=object))
    counts = Counter(trial.state.name.lower() for trial in trials).most_common()
    print(f"{len(trials)} trials: {', '.join(f'{count} {state}' for state, count in counts)}")
    if best:
        print(f"best: {shlex.join(plan.command(plan.values(best[0].params)))}")
    if interrupted_by is not None:
        print(f"interrupted; resume with the same command and --name {plan.folder.name}")
    print(f"study: {plan.folder}")
    return int(not best) if interrupted_by is None else 128 + interrupted_by


def _plan(options: argparse.Namespace, settings: Mapping[str, Any]) -> Plan:
    """Check what was asked for, down to what the search could draw."""
    from omegaconf import OmegaConf  # noqa: PLC0415

    from flyrl.cli.config import training_config  # noqa: PLC0415
    from flyrl.front.study import Plan, check_space, command_words, search_space  # noqa: PLC0415
    from flyrl.training.config import training_record  # noqa: PLC0415

    def configure(values: Mapping[str, Any]) -> TrainingConfig:
        record = OmegaConf.create(dict(settings))
        for key, value in values.items():
            OmegaConf.update(record, key, value, merge=False)
        return training_config(cast(dict[str, Any], OmegaConf.to_container(record)))

    def command(values: Mapping[str, Any]) -> list[str]:
        given = [
            word for word in options.overrides if word.lstrip("+").partition("=")[0] not in values
        ]
        return ["flyrl-train", *given, *command_words(values)]

    record = training_record(configure({}))
    known = configs_folder() / "search"
    path = Path(options.search or known / f"{record['algo']['name']}.yaml")
    if not path.is_file():
        names = ", ".join(sorted(each.name for each in known.glob("*.yaml")))
        raise ValueError(
            f"there is no search space {path} ({known} has {names}): write one, and name it with "
            "--search FILE.yaml"
        )
    space = search_space(read_space(path), {key: settings[key] for key in record}, str(path))
    name = options.name or datetime.datetime.now().astimezone().strftime("%Y-%m-%d_%H%M%S")
    if name in {".", ".."} or Path(name).name != name:
        raise ValueError(f"--name must be the name of a folder, got {name!r}")
    folder = Path(settings["runs_folder"]) / "studies" / name
    prune_after = None if options.no_pruning else options.prune_after
    plan = Plan(folder, configure, space, options.trials, options.seed, prune_after, command)
    check_space(plan, str(path))
    return plan


def read_space(path: Path) -> dict[str, Any]:
    """Keys of a file with a search space, and what each may be; ValueError if it holds none."""
    from omegaconf import OmegaConf  # noqa: PLC0415

    from flyrl.files import load_yaml  # noqa: PLC0415

    plain = load_yaml(path)  # without aliases, which OmegaConf would multiply
    if not isinstance(plain, dict) or not plain:
        raise ValueError(f"{path} must hold keys and what each may be, got {plain!r:.60}")
    # OmegaConf takes 1e-4 for a number, YAML 1.1 for text
    return cast(dict[str, Any], OmegaConf.to_container(OmegaConf.load(path)))


def compose_training(overrides: Sequence[str]) -> dict[str, Any]:
    """Settings that `train.py` would take with these overrides, as plain values.

    Raises
    ------
    ValueError
        An override that `train.py` refuses, or that asks for more than one run.
    """
    from flyrl.cli.arguments import (  # noqa: PLC0415
        Sweep,
        by_present_name,
        check_arguments,
        composed,
    )

    overrides = [*map(by_present_name, overrides)]
    sweep = check_arguments("train", ["-m", *overrides])
    if isinstance(sweep, Sweep) and len(sweep.jobs) != 1:
        raise ValueError(
            "flyrl tune trains one after the other, and searches what the search space says; it "
            f"takes no sweep, got {' '.join(overrides)}"
        )
    return composed("train", overrides)
