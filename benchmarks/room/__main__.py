"""Where a law is enough, where nothing helps, and where there is room for learning.

From the root of the repository: `python -m benchmarks.room` for every condition, or some by name;
what is in the file already is left alone. With `--policy`, a learned one meets both
laws under these conditions, on more episodes than the planner has time for.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike
from tqdm import tqdm

from benchmarks.fidelity.comparison import interval_text
from benchmarks.machine import machine
from benchmarks.room.conditions import CONDITIONS
from benchmarks.room.figure import LEAST_ROOM, better_law, draw, room, verdict
from benchmarks.room.law import NUM_LAWS, Settings, known, law, tuned
from benchmarks.room.planner import ROBUST, Planner, PlannerConfig
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.config import FIRST_SEED
from flyrl.evaluation.statistics import paired_difference, success_rate
from flyrl.files import write_text
from flyrl.policies import load_policy
from flyrl.rollouts import EpisodeRecord, Policy, run_episodes
from flyrl.tasks import Episode

OUTPUT: Final = Path(__file__).parent / "room.json"


def measure(config: EnvConfig, episodes: list[Episode], num_laws: int = NUM_LAWS) -> dict[str, Any]:
    """Successes and times of the laws, and the bound, of one condition.

    A published law that never fails is not tuned. Where it does, the best of `num_laws` walks, and
    flyrl's own with its usual settings: tuning may miss it by chance. The bound of an episode is
    the best of the laws and a planner that knows the future, which is only asked where they fail.
    """
    env = BatchedEnv(config, 8)
    by_name = known(env.task)
    settings, tuning = by_name["published"], {}
    walked = {"published": run_episodes(env, law(env.task, settings), episodes)}
    if not all(record.success for record in walked["published"]):
        walked["usual"] = run_episodes(env, law(env.task, by_name["usual"]), episodes)
        settings, tuning = tuned(env, num_laws), {"laws": num_laws}
    best = law(env.task, settings)
    walked["tuned"] = run_episodes(env, best, episodes)
    bound = [max(pair, key=_worth) for pair in zip(*walked.values(), strict=True)]
    failed = [i for i, record in enumerate(bound) if not record.success]
    planned = _planned(config, best, [episodes[i] for i in failed], PlannerConfig(), "planning")
    for i, record in zip(failed, planned, strict=True):
        bound[i] = max(bound[i], record, key=_worth)
    rows = {name: _row(records) for name, records in {**walked, "bound": bound}.items()}
    return {"law": dict(settings), **tuning, "horizon_s": bound[0].horizon_s, **rows}


def without_luck(config: EnvConfig, settings: Settings, episodes: list[Episode]) -> dict[str, Any]:
    """Successes of a planner whose plans have to do in futures that differ a little.

    Where a bound leaves room, it shows how much of that is luck.
    """
    best = law(config.resolved_task, settings)
    return _row(_planned(config, best, episodes, ROBUST, "planning without luck"))


def _planned(
    config: EnvConfig, start: Policy, episodes: list[Episode], how: PlannerConfig, text: str
) -> list[EpisodeRecord]:
    """Walk by a planner, one episode after the other."""
    env = BatchedEnv(config)
    planner = Planner(env, start, how)
    bar = tqdm(episodes, desc=text, unit="episode", disable=not episodes)
    return [record for each in bar for record in run_episodes(env, planner, [each])]


def learned(
    config: EnvConfig, policy: str, settings: Settings, episodes: list[Episode]
) -> dict[str, Any]:
    """Successes of a learned policy and of the laws, on held-out episodes of one condition."""
    env = BatchedEnv(config, 8)
    by_name = known(env.task)
    laws = {"published": by_name["published"], "usual": by_name["usual"], "tuned": settings}
    who = {
        "policy": load_policy(policy, env.task),
        **{name: law(env.task, each) for name, each in laws.items()},
    }
    return {name: _row(run_episodes(env, each, episodes)) for name, each in who.items()}


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
    """Share of successes with intervals, the room above the better law, and the verdict."""
    lines = [
        "| condition | published law | tuned law | robust bound | bound | room | verdict |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, row in results.items():
        who = ("published", "tuned", "robust", "bound")
        rates = [_rate(row[each]["success"]) if each in row else "" for each in who]
        lines.append(f"| {name} | {' | '.join(rates)} | {room(row):.0%} | {verdict(row)} |")
    lines += ["", "| condition | law | policy | policy - law | of the room | of the possible |"]
    lines += ["|---|---|---|---|---|---|"]
    for name, row in results.items():
        if "learned" in row:
            won = {who: np.array(each["success"]) for who, each in row["learned"].items()}
            better = won[better_law(row["learned"])]
            gain = paired_difference(1.0 * won["policy"] - better, np.random.default_rng(0))
            assert gain.value is not None
            # what the better law of these, more, episodes leaves to the bound of the few, and to
            # the bound or the policy, which may win where planning does not
            bound = np.array(row["bound"]["success"])
            also = won["policy"][: bound.size]
            both = np.append(bound[: also.size] | also, bound[also.size :])
            left = [float(np.mean(each) - np.mean(better)) for each in (bound, both)]
            shares = [f"{gain.value / each:.0%}" if each >= LEAST_ROOM else "" for each in left]
            rates = [_rate(better), _rate(won["policy"]), interval_text(gain, "+.0%")]
            lines.append(f"| {' | '.join([name, *rates, *shares])} |")
    return "\n".join(lines)


def _rate(successes: ArrayLike) -> str:
    won = np.asarray(successes)
    return interval_text(success_rate(int(won.sum()), won.size), ".0%")


def main() -> None:
    """Measure what is asked for, condition by condition."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.room", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument(
        "conditions", nargs="*", choices=(*CONDITIONS, "all"), default="all", metavar="CONDITION"
    )
    parser.add_argument("--episodes", type=int, default=20, help="held-out ones per condition")
    parser.add_argument("--laws", type=int, default=NUM_LAWS, help="that are tuned")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--show", action="store_true", help="only print what is in --output")
    parser.add_argument("--figure", type=Path, help="draw what is in --output, SVG or PNG")
    parser.add_argument("--policy", help="that meets the laws under these conditions")
    given = parser.parse_args()
    found = json.loads(given.output.read_text()) if given.output.exists() else {}
    results = found.get("conditions", {})

    def save() -> None:
        record = {"machine": machine(), "conditions": results}
        write_text(given.output, json.dumps(record, indent=1))

    names = CONDITIONS if "all" in given.conditions else given.conditions
    least = max(
        len(known(replace(EnvConfig(), **CONDITIONS[each]).resolved_task)) for each in names
    )
    if given.laws < least:
        parser.error(f"--laws: {given.laws}; allowed: {least} or more, the known ones among them")
    for name in () if given.show else names:
        print(f"{name} …", file=sys.stderr)
        config = replace(EnvConfig(), **CONDITIONS[name])
        episodes = [config.sample_episode(FIRST_SEED + i) for i in range(given.episodes)]
        if name not in results:
            results[name] = measure(config, episodes, given.laws)
            save()
        row = results[name]
        if given.policy is not None:
            row["learned"] = learned(config, given.policy, row["law"], episodes)
        elif room(row) >= LEAST_ROOM and "robust" not in row:
            row["robust"] = without_luck(config, row["law"], episodes)
        save()
    if given.figure:
        draw(results, given.figure)
    print(table(results))


if __name__ == "__main__":
    main()
