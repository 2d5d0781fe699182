"""Exit statuses of the commands, which docs/cli.md lists."""

import signal
from typing import Final

DONE: Final = 0

LEFT_OUT: Final = 1
"""Done, but something was left out, failed or came to something else: the command says what."""

UNUSABLE: Final = 2
"""The command line, or a file that it names, cannot be used."""

INTERRUPTED: Final = 128 + signal.SIGINT
"""Ended by Ctrl-C, as shells have it."""

PIPE_CLOSED: Final = 128 + 13  # SIGPIPE, which Windows has not
"""Whoever read the output wants no more of it, as `head`."""
