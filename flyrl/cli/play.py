"""flyrl play: a live page in the browser."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

_PORT: Final = 8080


def add_to(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "play",
        help="open a live page in the browser",
        description="Play with a simulation, live in the browser. The page is served to this "
        "computer alone. Ctrl-C ends it.",
        epilog="worm: the literature's hanging worm; key h recruits 20 more motor neurons, n 20 "
        "fewer. Example: flyrl play worm --port 9000",
    )
    parser.add_argument("name", metavar="NAME", help="what to play: worm")
    parser.add_argument(
        "--port",
        type=int,
        default=_PORT,
        help=f"where the page is served; 0 for any free port (default: {_PORT})",
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="open no browser, only print the address"
    )
    parser.add_argument(
        "--log",
        type=Path,
        metavar="FILE",
        help="write there what happens, a line of JSON per change; replaces what it held",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C, the ordinary end.

    Raises
    ------
    ValueError
        There is no such thing to play, or no such port.
    OSError
        The port is in use, or the log cannot be written.
    """
    try:
        return _play(options)
    except KeyboardInterrupt:
        print()
        return 0


def _play(options: argparse.Namespace) -> int:
    from flyrl.play import PLAYABLES, Session  # noqa: PLC0415
    from flyrl.validation import one_of, within  # noqa: PLC0415

    make = PLAYABLES[one_of("what to play", options.name, PLAYABLES)]
    if options.port != 0:
        within("--port", options.port, 1024, 65535)
    try:
        from flyrl.play.loopback import listen, url  # noqa: PLC0415
        from flyrl.play.page import PageUnavailableError, show  # noqa: PLC0415
    except ImportError as error:
        return _fail(f"mujoco.studio, which shows the page, cannot be used: {error}")
    with listen(options.port) as listening, _log(options.log) as log:
        session = Session(make(), log)
        print(f"{options.name}: {url(listening)} (Ctrl-C ends it)", flush=True)
        try:
            show(session, listening, opens_browser=not options.no_browser)
        except PageUnavailableError as error:
            return _fail(str(error))
    return 0


def _fail(reason: str) -> int:
    print(f"error: {reason}", file=sys.stderr)
    return 2


@contextmanager
def _log(path: Path | None) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """Give a function that writes an entry to a file, at once; or nowhere, without a path."""
    if path is None:
        yield lambda entry: None
        return
    with path.open("w", encoding="utf-8") as file:
        yield lambda entry: print(json.dumps(entry), file=file, flush=True)
