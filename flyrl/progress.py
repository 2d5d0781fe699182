"""Progress bars, on stderr, that look alike wherever something takes long."""

import io
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Final, NoReturn

from tqdm import tqdm

TERMINAL_INTERVAL_S: Final = 0.5
FILE_INTERVAL_S: Final = 30.0


@dataclass(frozen=True)
class _Job:
    """A job of several parts, which share one bar: the length of each, and what of it is done."""

    bar: "tqdm[NoReturn]"
    lengths: dict[str, float]
    done: dict[str, float]


_JOB: ContextVar[_Job | None] = ContextVar("_JOB", default=None)


@contextmanager
def whole_job(shares: Mapping[str, float]) -> Iterator[None]:
    """Draw one bar, with the rate and the time left, for the bars that are made inside the block.

    Parameters
    ----------
    shares
        Description of each of these bars -> how long it takes, in any unit. One that ends early
        takes what it leaves out off the whole. Other bars are drawn as ever; so are all where this
        is empty.
    """
    layout = "{desc} {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}{postfix}]"
    with progress_bar(sum(shares.values()), is_shown=bool(shares), unit="", layout=layout) as bar:
        # the parts say when to draw; the time left goes by the mean rate
        bar.mininterval, bar.miniters, bar.dynamic_miniters, bar.smoothing = 0, 0, False, 0
        token = _JOB.set(_Job(bar, dict(shares), dict.fromkeys(shares, 0.0)))
        try:
            yield
        finally:
            _JOB.reset(token)


class _Part(tqdm):  # type: ignore[type-arg]
    """A bar that, where it would be drawn, moves its part of the job's bar."""

    def display(self, msg: str | None = None, pos: int | None = None) -> None:
        """Move the job's bar to where this one is, with this one's rate."""
        job = _JOB.get()
        if job is None:
            return
        shown, bar = self.format_dict, job.bar
        mean = (self.n - self.initial) / max(shown["elapsed"], 1e-9)
        rate = f"{(shown['rate'] or mean) * (shown['unit_scale'] or 1):.3g}{self.unit}/s"
        bar.set_description_str(self.desc, refresh=False)
        bar.set_postfix_str(", ".join(filter(None, (rate, str(self.postfix or "")))), refresh=False)
        job.done[self.desc] = job.lengths[self.desc] * min(1, self.n / (self.total or 1))
        bar.update(sum(job.done.values()) - bar.n)

    def close(self) -> None:
        """Take what is left of this part, which ends early, off the job."""
        was_open, job = not self.disable, _JOB.get()
        super().close()  # which draws it
        if was_open and job is not None:
            job.lengths[self.desc] = job.done[self.desc]
            job.bar.total = sum(job.lengths.values())


def progress_bar(
    total: float,
    *,
    is_shown: bool,
    unit: str,
    unit_scale: float = 1,
    description: str | None = None,
    layout: str | None = None,
) -> "tqdm[NoReturn]":
    """Make a progress bar: a moving one on a terminal, a line now and then in a log file.

    Parameters
    ----------
    total
        Steps that it counts to.
    is_shown
        Whether to draw it at all.
    unit
        What is counted.
    unit_scale
        Units per step.
    description
        Stands in front; inside a `whole_job` that names it, the bar is a part of that job's.
    layout
        Format of the line, tqdm's `bar_format`; None takes tqdm's own.
    """
    job = _JOB.get()
    is_part = is_shown and job is not None and description in job.lengths
    bar: type[tqdm[NoReturn]] = _Part if is_part else tqdm
    return bar(
        total=total,
        desc=description,
        unit=unit,
        unit_scale=False if unit_scale == 1 else unit_scale,
        bar_format=layout,
        disable=not is_shown,
        mininterval=TERMINAL_INTERVAL_S if sys.stderr.isatty() else FILE_INTERVAL_S,
        dynamic_ncols=not is_part,
        file=io.StringIO() if is_part else None,
    )
