"""Search the contacts and the step of a preset for what is true to the literature, and fast.

    python tools/calibrate_physics.py balanced --trials 50 --study runs/calibration.db
    python tools/calibrate_physics.py balanced --try box.friction=1 --try timestep=5e-4,box.margin=0

`benchmarks/fidelity/calibration.py` says what is measured, and how it is summed up. A study goes on
where it was stopped. At the end the front is printed: nothing else is both truer and faster.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import optuna

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.fidelity.calibration import (  # noqa: E402
    Figures,
    Yardstick,
    candidate,
    distance,
    objective,
)
from flyrl.simulation.physics import FLY_PRESETS  # noqa: E402

STEPS_S: Final = (2.5e-4, 4e-4, 5e-4, 1e-3)
"""Steps of which a decision of 20 ms is a whole number."""

RANGES: Final[dict[str, tuple[float, float]]] = {
    "box.friction": (0.5, 1.1),
    "box.push_out": (15.0, 80.0),
    "box.first": (0.5, 0.999),
    "box.width": (0.001, 0.05),
    "box.margin": (0.0, 0.02),
    "plane.friction": (0.7, 1.1),
    "plane.across": (1.0, 1.5),
    "plane.push_out": (3.0, 12.0),
    "plane.damping": (1.5, 4.0),
    "plane.width": (0.05, 0.12),
}

NAMES: Final = ("timestep", *RANGES, "box.last", "box.damping", "plane.first")
"""What a candidate may change; `candidate` says what each is."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the command line, measure what it names or search, and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("preset", choices=FLY_PRESETS, help="what everything else is taken from")
    parser.add_argument(
        "--try", dest="tried", type=_changes, action="append", default=[], metavar="NAME=VALUE,…",
        help="measure this and do not search; again for another; '' is the preset itself",
    )  # fmt: skip
    parser.add_argument("--trials", type=int, default=50)
    parser.add_argument("--steps", nargs="+", type=float, choices=STEPS_S, default=STEPS_S)
    parser.add_argument("--study", type=Path, default=Path("runs/calibration.db"))
    parser.add_argument("--walks", type=int, default=48, help="starts per straight walk")
    parser.add_argument("--steered", type=int, default=100, help="starts per steered walk")
    parser.add_argument("--turns", type=int, default=8, help="flies per pair of drives")
    parser.add_argument("--threads", type=int, default=0, help="0 takes one per CPU")
    given = parser.parse_args(arguments)
    yardstick = Yardstick(given.walks, given.steered, given.turns, given.threads)
    if given.tried:
        for changes in given.tried:
            _report(changes, *yardstick.measure(candidate(given.preset, changes)))
        return
    study = _search(yardstick, given.preset, given.steps, given.trials, given.study)
    print("\nfront of truth against speed:")
    for trial in sorted(study.best_trials, key=lambda trial: trial.values):
        print(f"  {trial.values[0]:8.1f} at {trial.values[1]:.2f} s/s: {trial.params}")


def _changes(text: str) -> dict[str, float]:
    """Changes by name, from `NAME=VALUE,…`; none from an empty text."""
    changes = {}
    for part in filter(None, text.split(",")):
        name, _, value = part.partition("=")
        if name not in NAMES:
            raise argparse.ArgumentTypeError(f"{name!r}; allowed: {', '.join(NAMES)}")
        changes[name] = float(value)
    return changes


def _search(
    yardstick: Yardstick, preset: str, steps: Sequence[float], trials: int, path: Path
) -> optuna.Study:
    def measure(trial: optuna.Trial) -> tuple[float, float]:
        changes = {"timestep": trial.suggest_categorical("timestep", list(steps))}
        for name, (low, high) in RANGES.items():
            changes[name] = trial.suggest_float(name, low, high)
        figures, speed = yardstick.measure(candidate(preset, changes))
        trial.set_user_attr("figures", figures)
        _report(changes, figures, speed)
        return objective(figures), speed

    path.parent.mkdir(parents=True, exist_ok=True)
    study = optuna.create_study(
        study_name=preset,
        storage=f"sqlite:///{path}",
        directions=["minimize", "maximize"],
        load_if_exists=True,
    )
    study.optimize(measure, n_trials=trials)
    return study


def _report(changes: Mapping[str, float], figures: Figures, speed: float) -> None:
    """Print a candidate, its objective, and the figures that lie outside their range."""
    text = ", ".join(f"{name} {value:.4g}" for name, value in changes.items())
    print(f"{objective(figures):8.1f} at {speed:.2f} s/s: {text}")
    for name, value in figures.items():
        mark = "*" if distance(name, value) else " "
        print(f"  {mark} {name}: {value:.3g}", flush=True)


if __name__ == "__main__":
    main()
