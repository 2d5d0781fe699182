"""Where a law is enough, where nothing helps, and where there is room for learning.

From the root of the repository: `python -m benchmarks.room` for every condition, or some by name;
a condition that is in the file already is left alone.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from benchmarks.machine import machine
from benchmarks.room.conditions import CONDITIONS
from benchmarks.room.figure import draw, room, verdict
from benchmarks.room.law import published, tuned
from benchmarks.room.planner import Planner
from flyrl.envs.core import BatchedEnv, EnvConfig
from flyrl.evaluation.config import FIRST_SEED
from flyrl.evaluation.statistics import success_rate
from flyrl.files import write_text
from flyrl.policies.fixed import Pursuit
from flyrl.progress import progress_bar
from flyrl.rollouts import EpisodeRecord, run_episodes
from flyrl.validation import one_of

OUTPUT: Final = Path(__file__).parent / "room.json"


def measure(config: EnvConfig, episodes: int) -> dict[str, Any]:
    """Successes and times of the published law, the tuned one, and the bound, of one condition.

    The bound of an episode is the best of both laws and the planner, which is only asked where
    they fail.
    """
    env = BatchedEnv(config, 8)
    settings = tuned(env)
    drawn = [config.sample_episode(FIRST_SEED + i) for i in range(episodes)]
    literature, law = (Pursuit(env.task, **each) for each in (published(env.task)[0], settings))
    walked = {
        "published": run_episodes(env, literature, drawn),
        "tuned": run_episodes(env, law, drawn),
    }
    bound = [max(pair, key=_worth) for pair in zip(*walked.values(), strict=True)]
    failed = [i for i, record in enumerate(bound) if not record.success]
    alone = BatchedEnv(config)
    planner = Planner(alone, law)
    with progress_bar(
        len(failed), is_shown=bool(failed), unit="episode", description="planning"
    ) as bar:
        for i in failed:
            (record,) = run_episodes(alone, planner, [drawn[i]])
            bound[i] = max(bound[i], record, key=_worth)
            bar.update()
    return {
        "law": dict(settings),
        "horizon_s": bound[0].horizon_s,
        **{name: _row(records) for name, records in {**walked, "bound": bound}.items()},
    }


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
    """Share of successes with intervals, in %, the room above the tuned law, and the verdict."""
    lines = [
        "| condition | published law | tuned law | bound | room | verdict |",
        "|---|---|---|---|---|---|",
    ]
    for name, row in results.items():
        rates = [_percent(row[who]["success"]) for who in ("published", "tuned", "bound")]
        lines.append(f"| {name} | {' | '.join(rates)} | {100 * room(row):.0f} | {verdict(row)} |")
    return "\n".join(lines)


def _percent(successes: list[bool]) -> str:
    rate = success_rate(sum(successes), len(successes))
    assert rate.value is not None and rate.low is not None and rate.high is not None
    return f"{100 * rate.value:.0f} [{100 * rate.low:.0f}, {100 * rate.high:.0f}]"


def main() -> None:
    """Measure what is asked for, condition by condition."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.room", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("conditions", nargs="*", help=f"of {', '.join(CONDITIONS)}; all by default")
    parser.add_argument("--episodes", type=int, default=20, help="held-out ones per condition")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    parser.add_argument("--show", action="store_true", help="only print what is in --output")
    parser.add_argument("--figure", type=Path, help="draw what is in --output, SVG or PNG")
    given = parser.parse_args()
    names = given.conditions or list(CONDITIONS)
    for name in names:
        one_of("conditions", name, CONDITIONS)
    found = json.loads(given.output.read_text()) if given.output.exists() else {}
    results = found.get("conditions", {})
    for name in [] if given.show else names:
        if name in results:
            continue
        print(f"{name} …", file=sys.stderr)
        config = replace(EnvConfig(), **CONDITIONS[name])
        results[name] = measure(config, given.episodes)
        record = {"machine": machine(), "episodes": given.episodes, "conditions": results}
        write_text(given.output, json.dumps(record, indent=1))
    if given.figure:
        draw(results, given.figure)
    print(table(results))


if __name__ == "__main__":
    main()
