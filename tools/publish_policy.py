"""Put the best policy of a run into `assets/policies/`, with its model card.

    python tools/publish_policy.py runs/<run> target-flat    # judge it on 500 episodes, write both
    python tools/publish_policy.py --check                   # fail if a card is not its policy's

The policy is judged beside the fixed controllers on episodes that no run is trained or chosen on.
Settings, command, provenance and figures of the run go into the policy file itself; the card says
what the file says.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from flyrl.cli.config import training_config  # noqa: E402
from flyrl.evaluation import EvaluationConfig, evaluate  # noqa: E402
from flyrl.evaluation.metrics import compared_metrics  # noqa: E402
from flyrl.files import write_bytes, write_text  # noqa: E402
from flyrl.policies.bundle import load_bundle, policy_file, save_bundle  # noqa: E402
from flyrl.policies.card import model_card  # noqa: E402
from flyrl.policies.library import SUFFIX, named_policies, policies_folder  # noqa: E402
from flyrl.training.runs import read_record  # noqa: E402

LARGEST_BYTES: Final = 200_000


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the command line, then publish or check."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("run", nargs="?", type=Path, help="run folder")
    parser.add_argument("name", nargs="?", help="name of the policy, such as target-flat")
    parser.add_argument("--episodes", type=int, default=500, help="how many to judge it on")
    parser.add_argument("--num-threads", type=int, default=0, help="0: one per CPU")
    parser.add_argument("--folder", type=Path, default=policies_folder(), help="where it goes")
    parser.add_argument("--check", action="store_true", help="compare cards, write nothing")
    given = parser.parse_args(arguments)
    if given.check:
        sys.exit(check())
    if given.run is None or given.name is None:
        parser.error("name a run folder and the policy, or --check")
    try:
        publish(given.run, given.name, given.folder, given.episodes, given.num_threads)
    except (ValueError, OSError) as error:
        parser.error(str(error))


def check() -> int:
    """Name the policies whose card differs from what their file says; 1 if there are any."""
    stale = [
        name
        for name, path in named_policies().items()
        if not path.with_suffix(".md").is_file()
        or path.with_suffix(".md").read_text(encoding="utf-8")
        != model_card(name, load_bundle(path))
    ]
    for name in stale:
        print(f"{name}: its card is missing, or says something else than the policy file")
    return int(bool(stale))


def publish(run: Path, name: str, folder: Path, episodes: int, num_threads: int) -> None:
    """Judge the best policy of a run, and write it and its card to `folder`.

    Raises
    ------
    ValueError
        A name that cannot be one, no run, a run of uncommitted code, or a policy that is too large.
    OSError
        A part of the run folder is missing.
    """
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
        raise ValueError(f"name: {name!r}; allowed: small letters and digits, joined by hyphens")
    record = read_record(run)
    provenance = json.loads((run / "provenance.json").read_text())
    if (provenance["git"] or {}).get("is_dirty"):
        raise ValueError(f"{run} ran code that is in no commit; see its code.diff")
    _check_size(policy_file(run).stat().st_size)  # before it is judged, which takes minutes
    bundle = load_bundle(run)
    training = {
        # a policy of today holds its own
        "settings": {group: record[group] for group in ("algo", "training")},
        **bundle.training,
        "command": _command_anywhere((run / "command.txt").read_text()),
        "provenance": {**provenance, "cpu": {"model": provenance["cpu"]["model"]}},
        "held_out": judge(run, record, episodes, num_threads),
    }
    bundle = dataclasses.replace(bundle, training=training)
    with tempfile.TemporaryDirectory() as scratch:
        save_bundle(bundle, Path(scratch) / "policy")
        data = (Path(scratch) / "policy").read_bytes()
    _check_size(len(data))
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / f"{name}{SUFFIX}", data)
    write_text(folder / f"{name}.md", model_card(name, bundle))
    print(f"policy: {folder / name}{SUFFIX} ({len(data)} bytes)")


def _check_size(size: int) -> None:
    if size > LARGEST_BYTES:
        raise ValueError(f"the policy has {size} bytes; allowed: {LARGEST_BYTES}")


def _command_anywhere(command: str) -> str:
    """Command without the places that interpreter and script had on the machine it ran on."""
    words = shlex.split(command)
    return shlex.join(Path(word).name if Path(word).is_absolute() else word for word in words)


def judge(run: Path, record: dict[str, Any], episodes: int, num_threads: int) -> dict[str, Any]:
    """Figures of the policy and of the fixed controllers on the same episodes."""
    env = training_config(record).env
    config = EvaluationConfig(
        policies=(str(policy_file(run)),),
        task=env.resolved_task,
        terrains=(env.scene.terrain,),
        body=env.scene.body,
        physics=env.scene.physics,
        randomisation=env.resolved_randomisation,
        episodes=episodes,
        num_threads=num_threads,
        progress=True,
    )
    kept = ("controller", "outcomes", "success_rate", "metrics", "paired")
    results = [{key: row[key] for key in kept} for row in evaluate(config).summaries]
    return {
        "episodes": episodes,
        "seed": config.seed,
        "compared": list(compared_metrics(config.resolved_task)),
        "results": results,
    }


if __name__ == "__main__":
    main()
