"""What many flies cost besides stepping: construction, memory, resets.

`measure` runs this module in a process of its own, so that no other part's memory counts.
"""

import gc
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import mujoco
import numpy as np
import psutil

from benchmarks.speed.results import Row, significant
from flyrl.envs.core import BatchedEnv, EnvConfig

FLIES: Final = 1024
RESETS: Final = 20
"""Timed resets of two flies."""


def measure() -> list[Row]:
    """Measure in a fresh process: task `target`, balanced physics, flat ground."""
    command = [sys.executable, "-m", "benchmarks.speed.scale"]
    found = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    rows: list[Row] = json.loads(found.stdout)
    return rows


def _measure_here(flies: int, resets: int) -> Row:
    # what a process pays once (imports, the compiled callback) is paid here
    first = BatchedEnv(EnvConfig(), 1)
    first.reset(seeds=[0])
    first.step(np.zeros((1, 2)))
    gc.collect()
    before = _resident_bytes()
    with counted_compilations() as in_construction:
        began = time.perf_counter()
        env = BatchedEnv(EnvConfig(), flies)
        construction_s = time.perf_counter() - began
    env.reset(seeds=list(range(flies)))
    env.step(np.zeros((flies, 2)))
    gc.collect()
    resident = _resident_bytes() - before
    times = []
    with counted_compilations() as in_resets:
        for k in range(resets):
            ids = [2 * k % flies, (2 * k + 1) % flies]
            began = time.perf_counter()
            env.reset(ids=ids)
            times.append(time.perf_counter() - began)
    return {
        "flies": flies,
        "construction_s": significant(construction_s),
        "mb_per_fly": significant(resident / flies / 1e6),
        "reset_two_ms": significant(1e3 * float(np.median(times))),
        "compilations_in_construction": len(in_construction),
        "compilations_in_resets": len(in_resets),
    }


@contextmanager
def counted_compilations() -> Iterator[list[Any]]:
    """Collect the specifications that are compiled to models while the block runs."""
    compiled: list[Any] = []
    compile_spec = mujoco.MjSpec.compile

    def counting(spec: Any, *args: Any, **kwargs: Any) -> Any:
        compiled.append(spec)
        return compile_spec(spec, *args, **kwargs)

    mujoco.MjSpec.compile = counting
    try:
        yield compiled
    finally:
        mujoco.MjSpec.compile = compile_spec


def _resident_bytes() -> int:
    """Memory of this process that lies in RAM."""
    return int(psutil.Process().memory_info().rss)


if __name__ == "__main__":
    print(json.dumps([_measure_here(FLIES, RESETS)]))
