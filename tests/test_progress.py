import io
import re
import sys

import pytest

from flyrl.progress import progress_bar, whole_job


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("stream", "interval_s"), [(io.StringIO, 30), (Terminal, 0.5)])
def test_a_log_file_gets_fewer_lines_than_a_terminal(monkeypatch, stream, interval_s):
    monkeypatch.setattr(sys, "stderr", stream())
    with progress_bar(3, is_shown=True, unit=" jobs") as bar:
        assert bar.mininterval == interval_s


def _lines():
    """What stood on the line, one state after the other."""
    return [line.strip() for line in sys.stderr.getvalue().split("\r") if line.strip()]


def test_the_bars_of_a_job_are_one_bar(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with whole_job({"walking": 3, "filming": 1}):
        with progress_bar(10, is_shown=True, unit=" steps", description="walking") as bar:
            bar.set_postfix({"success": "5%"})
            bar.update(5)
            bar.refresh()
            walked = _lines()
            bar.update(5)
        with progress_bar(4, is_shown=True, unit=" videos", description="filming") as bar:
            bar.update(2)
            bar.refresh()
            filmed = _lines()
    # half of three quarters; then all of these and half of the last
    assert re.match(r"walking +38%\|.*\[00:0.<.*, .* steps/s, success=5%\]", walked[-1])
    assert re.match(r"filming +88%\|.*\[00:0.<.*, .* videos/s\]", filmed[-1])
    assert all(line.startswith(("0%", "walking", "filming")) for line in _lines())


def test_what_a_part_leaves_out_is_no_time_left(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with whole_job({"training": 6, "filming": 2}):
        with progress_bar(9, is_shown=True, unit=" steps", description="training") as bar:
            bar.update(3)
        with progress_bar(4, is_shown=True, unit=" videos", description="filming") as bar:
            bar.refresh()
            filming = _lines()
            bar.update(4)
    # 2 of the 4 that it took in the end
    assert re.match(r"filming +50%\|", filming[-1])
    assert re.match(r"filming +100%\|", _lines()[-1])


def test_a_part_inside_another_leaves_the_bar_where_it_is(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with (
        whole_job({"teacher": 2, "training": 2}),
        progress_bar(4, is_shown=True, unit=" steps", description="training") as training,
    ):
        training.refresh()
        with progress_bar(4, is_shown=True, unit=" steps", description="teacher") as teacher:
            teacher.update(4)
        training.update(2)
        training.refresh()
        shown = [int(match[1]) for line in _lines() if (match := re.search(r"(\d+)%", line))]
    assert shown == sorted(shown)
    assert shown[-1] == 75


def test_a_bar_that_is_no_part_of_the_job_is_its_own_and_one_that_is_not_shown_none(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with whole_job({}):
        for is_shown in (False, True):
            assert _lines() == []
            with progress_bar(4, is_shown=is_shown, unit=" steps", description="walking") as bar:
                bar.update(4)
    assert "walking: 100%" in _lines()[-1]
