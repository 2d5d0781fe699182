"""What both published packages are run with: the tutorials' oscillators, and one file per run.

Needs NumPy alone, as their interpreters have no flyrl.
"""

import argparse
import json
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import machine

TIMESTEP_S: Final = 1e-4
SAMPLING_S: Final = 1e-3
CONTACT_THRESHOLD: Final = 1.0
"""µN; as flyrl's."""

SENSED: Final = ("Tibia", "Tarsus1", "Tarsus2", "Tarsus3", "Tarsus4", "Tarsus5")

_LEGS: Final = np.arange(6)
_DIFFER: Final = (_LEGS[:, None] + _LEGS) % 2 == 1

TRIPOD: Final = {
    "timestep": TIMESTEP_S,
    "intrinsic_freqs": np.full(6, 12.0),
    "intrinsic_amps": np.ones(6),
    "coupling_weights": 10.0 * _DIFFER,
    "phase_biases": np.pi * _DIFFER,
    "convergence_coefs": np.full(6, 20.0),
}
"""Arguments of the packages' CPGNetwork."""


def spawn(seed: int) -> NDArray[np.float64]:
    """X and y that flyrl's `hybrid_turning` draws for a seed, mm."""
    return np.random.default_rng(seed).uniform(-2.0, 2.0, size=2)


def phases(seed: int) -> NDArray[np.float64]:
    """Phases of the oscillators that it draws for a seed, rad."""
    return np.random.RandomState(seed).uniform(0.0, 2 * np.pi, size=6)


def in_contact(forces: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each leg is pushed, given the forces on all `SENSED` segments, µN, (36, 3)."""
    leg_forces = forces.reshape(6, len(SENSED), 3).sum(axis=1)
    return np.asarray(np.linalg.norm(leg_forces, axis=1) > CONTACT_THRESHOLD)


def parser(
    about: str | None,
    terrains: Iterable[str],
    controllers: Sequence[str],
    seeds: Sequence[int],
    seconds: float,
) -> argparse.ArgumentParser:
    """Command line of a package's runs, with its usual values."""
    parser = argparse.ArgumentParser(description=(about or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the runs are kept")
    parser.add_argument("--terrains", nargs="+", choices=terrains, default=list(terrains))
    parser.add_argument("--controllers", nargs="+", choices=controllers, default=controllers)
    parser.add_argument("--seeds", nargs="+", type=int, default=seeds)
    parser.add_argument("--seconds", type=float, default=seconds, help="simulated time of a run")
    return parser


def keep(
    chosen: argparse.Namespace,
    kinds: Iterable[str],
    packages: Iterable[str],
    run: Callable[[str, str, int], tuple[list[dict[str, Any]], dict[str, Any]]],
) -> None:
    """Run what is not there yet, seed by seed.

    Parameters
    ----------
    chosen
        What `parser` read.
    kinds
        Of the runs: controllers, or drives.
    packages
        Whose versions are kept.
    run
        Samples and further facts of a run on a terrain, of a kind, from a seed.
    """
    chosen.folder.mkdir(parents=True, exist_ok=True)
    for seed in chosen.seeds:
        for terrain in chosen.terrains:
            for kind in kinds:
                path = chosen.folder / f"{terrain}-{kind}-{seed}.npz"
                if path.exists():
                    continue
                samples, facts = run(terrain, kind, seed)
                about = {"terrain": terrain, "seed": seed, **facts, "machine": machine(packages)}
                series: dict[str, Any] = {
                    name: np.array([each[name] for each in samples]) for name in samples[0]
                }
                times = SAMPLING_S * np.arange(len(samples))
                partial = path.with_name(f".partial-{os.getpid()}-{path.name}")
                np.savez_compressed(partial, time=times, about=json.dumps(about), **series)
                partial.replace(path)
                halfway = series["position_w"][: round(0.5 / SAMPLING_S) + 1, 0]
                print(f"{path.stem}: x {halfway[-1] - halfway[0]:.4f} mm at 0.5 s", flush=True)
