import io
import sys

import pytest

from flyrl.progress import progress_bar


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("stream", "interval_s"), [(io.StringIO, 30), (Terminal, 0.5)])
def test_a_log_file_gets_fewer_lines_than_a_terminal(monkeypatch, stream, interval_s):
    monkeypatch.setattr(sys, "stderr", stream())
    with progress_bar(3, is_shown=True, unit=" jobs") as bar:
        assert bar.mininterval == interval_s


def test_nothing_is_drawn_unless_asked_for(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with progress_bar(3, is_shown=False, unit=" jobs") as bar:
        bar.update(3)
    assert sys.stderr.getvalue() == ""
