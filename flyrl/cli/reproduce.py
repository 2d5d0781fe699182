"""flyrl reproduce: repeat a run from its settings, and say what differs."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flyrl.cli.program import Subparsers, path_argument, program
from flyrl.cli.reproduce_report import DIFFERENT, IDENTICAL, REPORTS, reproduce_report
from flyrl.entry_points import check_trust
from flyrl.text import printable
from flyrl.training.runs import RunSummary, read_run

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyrl.policies.bundle import PolicyBundle
    from flyrl.training.learn import Run


@dataclass(frozen=True)
class Comparison:
    """What differs between a run and its repeat.

    Attributes
    ----------
    policy
        How the final policies differ; None if they are the same bits.
    evaluations
        Where the evaluations differ first; None if they are the same.
    origins
        What differs in code, packages and machine, a line each.
    """

    policy: str | None
    evaluations: str | None
    origins: tuple[str, ...]

    @property
    def is_identical(self) -> bool:
        """Whether the repeat came to the same."""
        return self.policy is None and self.evaluations is None


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "reproduce",
        help="repeat a run, or the evaluation of a report, and compare",
        description="Train again, from the settings of a finished run, in a new folder; then say "
        "whether the final policy and the evaluations are the same, to the bit. Or walk the "
        "episodes of a report again.",
        epilog="Exit status: 0 if they are, 1 if not, 2 for an error. Example: flyrl reproduce "
        "runs/2026-01-31_120000_target_flat_ppo_0",
    )
    parser.add_argument(
        "original",
        type=path_argument,
        metavar="RUN",
        help="folder of the run to repeat, or a report.html",
    )
    parser.add_argument(
        "--runs-folder", type=path_argument, default=Path("runs"), help="where to (default: runs)"
    )
    parser.add_argument(
        "--repeat",
        type=path_argument,
        metavar="FOLDER",
        help="compare with this repeat, made before; one that was interrupted goes on first",
    )
    parser.add_argument(
        "--output",
        type=path_argument,
        metavar="FOLDER",
        help="of a report: where to write the repeat's",
    )
    parser.add_argument(
        "--trust",
        action="store_true",
        help="run the code that it names (terms, policies as module:attribute, pickles)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Repeat the run, or the evaluation, and compare."""
    if options.original.suffix in REPORTS:
        return reproduce_report(options.original, is_trusted=options.trust, output=options.output)
    original = read_run(options.original)
    if original.state != "finished":
        said = "; ".join(original.problems) or f"it is {original.state}"
        raise ValueError(f"{options.original} is no finished run to compare with: {said}")
    check_trust(options.original, original.settings, options.trust, "--trust")
    from flyrl.policies.bundle import load_bundle  # noqa: PLC0415

    load_bundle(_last(original))  # so that damage shows before hours of training
    if options.repeat is None:
        print("repeating the run", file=sys.stderr)
    again = _train(original, options)
    if again is not None and again.interrupted_by is not None:
        go_on = ["flyrl", "reproduce", str(options.original), "--repeat", str(again.folder)]
        print(f"interrupted; go on with: {shlex.join(go_on)}", file=sys.stderr)
        return 128 + again.interrupted_by
    repeat = read_run(options.repeat if again is None else again.folder)
    result = compare(original, repeat)
    print(f"policy: {result.policy or 'identical, bit for bit'}")
    print(f"evaluations: {printable(result.evaluations or 'identical')}")
    for line in result.origins or ("same code, packages and CPU",):
        print(f"where from: {line}")
    print(f"repeat: {repeat.path}")
    return IDENTICAL if result.is_identical else DIFFERENT


def _train(original: RunSummary, options: argparse.Namespace) -> Run | None:
    """Train anew, or go on with the repeat that was asked for; None if that is finished."""
    if options.repeat is not None:
        repeat = read_run(options.repeat)
        if _without_logger(repeat.settings) != _without_logger(original.settings):
            raise ValueError(f"{options.repeat} is no repeat: it has other settings")
        if repeat.state == "finished":
            return None
    from flyrl.cli.config import training_config  # noqa: PLC0415
    from flyrl.training.learn import resume, train  # noqa: PLC0415

    config = training_config(_without_logger(original.settings))
    command = [*program(), *sys.argv[1:]]
    if options.repeat is not None:
        return resume(config, options.repeat, command)
    return train(config, options.runs_folder, command)


def _without_logger(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of the same training, without a logger."""
    return {key: value for key, value in settings.items() if key != "logger"}


def compare(original: RunSummary, repeat: RunSummary) -> Comparison:
    """Compare a run with its repeat.

    Raises
    ------
    PolicyFileError
        The final policy of one of them cannot be read.
    """
    from flyrl.policies.bundle import load_bundle  # noqa: PLC0415

    bundles = [load_bundle(_last(run)) for run in (original, repeat)]
    return Comparison(
        policy=difference(*bundles),
        evaluations=_evaluations_differ(original, repeat),
        origins=tuple(_origins_differ(original.provenance, repeat.provenance)),
    )


def _last(run: RunSummary) -> Path:
    return run.path / "last.safetensors"


def difference(first: PolicyBundle, second: PolicyBundle) -> str | None:
    """How two policies differ in what they make of an observation; None if in no bit."""
    others = _architecture(second)
    for key, value in _architecture(first).items():
        if value != others[key]:
            return f"{key} {value}, in the repeat {others[key]}"
    differences = (
        _arrays_differ("parameters", _parameters(first), _parameters(second)),
        _arrays_differ("statistics of the normaliser", _statistics(first), _statistics(second)),
    )
    return "; ".join(filter(None, differences)) or None


def _architecture(bundle: PolicyBundle) -> dict[str, Any]:
    """All that decides how the policy acts, but for its arrays: these are of the same shapes."""
    normaliser = bundle.normaliser
    return {
        "layers": bundle.network.sizes,
        "LSTM": bundle.lstm and bundle.lstm.sizes,
        "activation": bundle.network.activation,
        "squashing": bundle.squashing,
        "observation": [(term.name, term.size) for term in bundle.observation],
        "action bounds": (bundle.action_low, bundle.action_high),
        "normaliser's epsilon and clip": normaliser and (normaliser.epsilon, normaliser.clip),
    }


def _parameters(bundle: PolicyBundle) -> list[NDArray[Any]]:
    layers = (*bundle.network.layers, *(bundle.lstm.layers if bundle.lstm else ()))
    return [array for layer in layers for array in vars(layer).values()]


def _statistics(bundle: PolicyBundle) -> list[NDArray[Any]]:
    return [bundle.normaliser.mean, bundle.normaliser.variance] if bundle.normaliser else []


def _arrays_differ(
    what: str, first: Sequence[NDArray[Any]], second: Sequence[NDArray[Any]]
) -> str | None:
    pairs = list(zip(first, second, strict=True))
    bits = [[array.view(f"u{array.itemsize}") for array in pair] for pair in pairs]
    changed = sum(int((one != other).sum()) for one, other in bits)
    if not changed:
        return None
    largest = max(float(abs(one.astype("f8") - other).max()) for one, other in pairs)
    total = sum(one.size for one, _ in pairs)
    return f"{changed} of {total} {what} differ, by at most {largest:.3g}"


def _evaluations_differ(original: RunSummary, repeat: RunSummary) -> str | None:
    pairs = zip(original.evaluations, repeat.evaluations, strict=False)
    for one, other in pairs:
        for key, value in one.items():
            if value != other.get(key):
                return (
                    f"differ from decision {one['decisions']:.0f} on: {key} {value:.6g}, "
                    f"in the repeat {other.get(key, math.nan):.6g}"
                )
    counts = len(original.evaluations), len(repeat.evaluations)
    return None if counts[0] == counts[1] else "{}, in the repeat {}".format(*counts)


def _origins_differ(original: Mapping[str, Any], repeat: Mapping[str, Any]) -> list[str]:
    """What differs in commit, versions and machine, from run to repeat and within each."""
    from flyrl.training.provenance import differences  # noqa: PLC0415

    lines = differences(original, repeat, "in the repeat")
    for name, origin in (("run", original), ("repeat", repeat)):
        resumed = origin.get("resumed")
        for later in resumed if isinstance(resumed, list) else ():
            lines += [
                f"within the {name}: {line}"
                for line in differences(origin, later, "after an interruption")
            ]
    return lines
