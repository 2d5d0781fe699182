"""`flyrl play` as a process, and its log."""

import json
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

FLY = ("-m", "flyrl", "play", "--physics=fast", "--policy=none", "fly")
WORM = ("-m", "flyrl", "play", "worm")
TOY = ("-m", "tests.play.toy")


class Playing:
    """A running `flyrl play`: its process, the address that it printed, its log."""

    def __init__(self, process, url, log):
        self.process, self.url, self._log = process, url, log

    def entries(self):
        return [json.loads(line) for line in self._lines()]

    def latest(self):
        return json.loads(self._lines()[-1])

    def until(self, is_so, limit_s=90.0):
        """Wait for an entry that is so, as the last; return it."""
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            assert self.process.poll() is None, "it has ended"
            # the page is served before there is something to play, and a log
            if (lines := self._lines()) and is_so(entry := json.loads(lines[-1])):
                return entry
            time.sleep(0.02)
        raise AssertionError(f"the log never says so; its end: {self.entries()[-3:]}")

    def _lines(self):
        """Whole lines: the last one may be in the middle of being written."""
        return self._log.read_text().rpartition("\n")[0].splitlines()

    def interrupt(self):
        """Ctrl-C; return the exit status and what was said."""
        self.process.send_signal(signal.SIGINT)
        out, err = self.process.communicate(timeout=20)
        return self.process.returncode, out, err


@contextmanager
def playing(log, what=WORM):
    """Play a fly, a worm or a toy; videos come beside the log."""
    options = ["--no-browser", "--port=0", f"--log={log}", f"--record-folder={log.parent}"]
    process = subprocess.Popen(
        [sys.executable, *what, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        line = process.stdout.readline()
        assert line.startswith(f"{what[-1].split('.')[-1]}: http"), process.communicate(timeout=20)
        yield Playing(process, re.search(r"http://127\.0\.0\.1:\d+/", line)[0], log)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
