"""Where a law is enough, where nothing helps, and where there is room for learning.

From the root of the repository: `python -m benchmarks.room` for every condition, or some by name;
what is in the file already is left alone. With `--policy`, a learned one meets both
laws under these conditions, on more episodes than the planner has time for.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.machine import machine
from benchmarks.room.conditions import CONDITIONS
from benchmarks.room.figure import LEAST_ROOM, better_law, draw, room, verdict
from benchmarks.room.law import Settings, law, published, tuned
from benchmarks.room.planner import Planner, PlannerConfig
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.config import FIRST_SEED
from flyrl.evaluation.statistics import Interval, paired_difference, success_rate
from flyrl.files import write_text
from flyrl.policies import load_policy
from flyrl.progress import progress_bar
from flyrl.rollouts import EpisodeRecord, Policy, run_episodes
from flyrl.tasks import Episode
from flyrl.validation import one_of

ROBUST: Final = PlannerConfig(tries=4, noise=0.1)
"""Of a planner that knows the state and the ground, and not where a stumble leads."""

OUTPUT: Final = Path(__file__).parent / "room.json"


def measure(config: EnvConfig, episodes: int) -> dict[str, Any]:
    """Successes and times of the published law, the tuned one, and the bound, of one condition.

    A law that never fails is not tuned. The bound of an episode is the best of both laws and a
    planner that knows the future, which is only asked where they fail.
    """
    env = BatchedEnv(config, 8)
    drawn = [config.sample_episode(FIRST_SEED + i) for i in range(episodes)]
    settings = published(env.task)[0]
    walked = {"published": run_episodes(env, law(env.task, settings), drawn)}
    if not all(record.success for record in walked["published"]):
        settings = tuned(env)
    best = law(env.task, settings)
    walked["tuned"] = run_episodes(env, best, drawn)
    bound = [max(pair, key=_worth) for pair in zip(*walked.values(), strict=True)]
    failed = [i for i, record in enumerate(bound) if not record.success]
    planned = _planned(config, best, [drawn[i] for i in failed], PlannerConfig(), "planning")
    for i, record in zip(failed, planned, strict=True):
        bound[i] = max(bound[i], record, key=_worth)
    rows = {name: _row(records) for name, records in {**walked, "bound": bound}.items()}
    return {"law": dict(settings), "horizon_s": bound[0].horizon_s, **rows}


def without_luck(config: EnvConfig, settings: Settings, episodes: int) -> dict[str, Any]:
    """Successes of a planner whose plans have to do in futures that differ a little.

    Where a bound leaves room, it shows how much of that is luck.
    """
    best = law(config.resolved_task, settings)
    drawn = [config.sample_episode(FIRST_SEED + i) for i in range(episodes)]
    return _row(_planned(config, best, drawn, ROBUST, "planning without luck"))


def _planned(
    config: EnvConfig, start: Policy, episodes: list[Episode], how: PlannerConfig, text: str
) -> list[EpisodeRecord]:
    """Walk by a planner, one episode after the other."""
    env = BatchedEnv(config)
    planner, records = Planner(env, start, how), []
    with progress_bar(
        len(episodes), is_shown=bool(episodes), unit="episode", description=text
    ) as bar:
        for episode in episodes:
            records += run_episodes(env, planner, [episode])
            bar.update()
    return records


def learned(config: EnvConfig, policy: str, settings: Settings, episodes: int) -> dict[str, Any]:
    """Successes of a learned policy and of both laws, on held-out episodes of one condition."""
    env = BatchedEnv(config, 8)
    drawn = [config.sample_episode(FIRST_SEED + i) for i in range(episodes)]
    who = {
        "policy": load_policy(policy, env.task),
        "published": law(env.task, published(env.task)[0]),
        "tuned": law(env.task, settings),
    }
    return {name: _row(run_episodes(env, each, drawn)) for name, each in who.items()}


def _worth(record: EpisodeRecord) -> tuple[bool, float]:
    return record.success, -record.duration_s if record.success else record.return_


def _row(records: list[EpisodeRecord]) -> dict[str, Any]:
    """Success and duration of each episode, s, and how those that failed ended."""
    return {
        "success": [record.success for record in records],
        "duration_s": [round(record.duration_s, 4) for record in records],
        "outcome": [record.outcome for record in records],
    }


def table(results: dict[str, Any]) -> str:
    """Share of successes with intervals, in %, the room above the better law, and the verdict."""
    lines = [
        "| condition | published law | tuned law | robust bound | bound | room | verdict |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, row in results.items():
        who = ("published", "tuned", "robust", "bound")
        rates = [_percent(row[each]["success"]) if each in row else "" for each in who]
        lines.append(f"| {name} | {' | '.join(rates)} | {100 * room(row):.0f} | {verdict(row)} |")
    if any("learned" in row for row in results.values()):
        lines += [
            "",
            "| condition | best law | policy | policy - law | share of the room |",
            "|---|---|---|---|---|",
        ]
    for name, row in results.items():
        if "learned" in row:
            won = {who: np.array(each["success"]) for who, each in row["learned"].items()}
            better = won[better_law(row["learned"])]
            gain = 1.0 * won["policy"] - better
            between = paired_difference(gain, np.random.default_rng(0))
            spread = "" if between.low is None else _interval(between)
            closed = f"{100 * gain.mean() / room(row):.0f} %" if room(row) >= LEAST_ROOM else ""
            rates = [_percent(list(each)) for each in (better, won["policy"])]
            gained = f"{100 * gain.mean():+.0f}{spread}"
            lines.append(f"| {name} | {' | '.join(rates)} | {gained} | {closed} |")
    return "\n".join(lines)


def _percent(successes: list[bool]) -> str:
    rate = success_rate(sum(successes), len(successes))
    assert rate.value is not None
    return f"{100 * rate.value:.0f}{_interval(rate)}"


def _interval(rate: Interval) -> str:
    assert rate.low is not None and rate.high is not None
    return f" [{100 * rate.low:.0f}, {100 * rate.high:.0f}]"


def _add_what_is_missing(
    results: dict[str, Any], names: list[str], episodes: int, robust_episodes: int
) -> Iterator[None]:
    """Measure conditions, one step after another; what takes longest comes last."""
    for name in names:
        if name not in results:
            results[name] = measure(_config(name), episodes)
            yield
    for name in names:
        row = results[name]
        if room(row) >= LEAST_ROOM and "robust" not in row:
            walked = min(robust_episodes, len(row["bound"]["success"]))
            row["robust"] = without_luck(_config(name), row["law"], walked)
            yield


def _add_learned(
    results: dict[str, Any], names: list[str], episodes: int, policy: str
) -> Iterator[None]:
    """Let a policy meet both laws, condition by condition."""
    for name in names:
        row = results[name]
        row["learned"] = learned(_config(name), policy, row["law"], episodes)
        yield


def _config(name: str) -> EnvConfig:
    print(f"{name} …", file=sys.stderr)
    return replace(EnvConfig(), **CONDITIONS[name])


def main() -> None:
    """Measure what is asked for, condition by condition."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.room", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("conditions", nargs="*", help=f"of {', '.join(CONDITIONS)}; all by default")
    parser.add_argument("--episodes", type=int, default=20, help="held-out ones per condition")
    parser.add_argument(
        "--robust-episodes",
        type=int,
        default=20,
        help="of them for the robust bound, minutes each",
    )
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--show", action="store_true", help="only print what is in --output")
    parser.add_argument("--figure", type=Path, help="draw what is in --output, SVG or PNG")
    parser.add_argument("--policy", help="that meets the laws under these conditions")
    given = parser.parse_args()
    names = given.conditions or list(CONDITIONS)
    for name in names:
        one_of("conditions", name, CONDITIONS)
    found = json.loads(given.output.read_text()) if given.output.exists() else {}
    results = found.get("conditions", {})
    if not given.show:
        asked = results, names, given.episodes
        steps = (
            _add_what_is_missing(*asked, given.robust_episodes)
            if given.policy is None
            else _add_learned(*asked, given.policy)
        )
        for _ in steps:
            record = {"machine": machine(), "conditions": results}
            write_text(given.output, json.dumps(record, indent=1))
    if given.figure:
        draw(results, given.figure)
    print(table(results))


if __name__ == "__main__":
    main()
