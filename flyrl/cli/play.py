"""flyrl play: a live page in the browser."""

from __future__ import annotations

import argparse
import json
import os
import sys
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from flyrl.cli.terminal import Subparsers, path_argument

if TYPE_CHECKING:
    from flyrl.play.session import Playable

_PORT: Final = 8080

_PILOT: Final = "target-any"
"""Default of --policy."""

_NONE: Final = "none"
"""Value of --policy: a person."""

NAMES: Final = ("fly", "worm")

_OF_THE_FLY: Final = {
    "terrain": "what it walks on: a name, or module:attribute of your own",
    "controller": "what moves its legs: a name, or module:attribute of your own",
    "gait": "order in which its legs step",
    "physics": "preset of the physics",
    "body": "which fly",
    "policy": f"what steers it to targets at first (default: {_PILOT}); {_NONE!r}: a person",
    "seed": "of its first reset",
}
"""Options that a fly alone has."""


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "play",
        help="open a live page in the browser",
        description="Play with a simulation, live in the browser. The page is served to this "
        "computer alone. Ctrl-C ends it.",
        epilog="fly: a policy steers it, until arrow keys or sliders do. worm: the literature's "
        "worm in mid air; key h recruits 20 more motor neurons, n 20 fewer. "
        "Examples: flyrl play; flyrl play fly --terrain blocks --controller hybrid; "
        "flyrl play worm --port 9000",
    )
    parser.add_argument(
        "name",
        metavar="NAME",
        nargs="?",
        default=NAMES[0],
        help=f"what to play: {' or '.join(NAMES)} (default: {NAMES[0]})",
    )
    fly = parser.add_argument_group("the fly, as it begins; all this can be changed in the page")
    for option, about in _OF_THE_FLY.items():
        kind = int if option == "seed" else str
        fly.add_argument(f"--{option}", type=kind, metavar=option.upper(), help=about)
    page = parser.add_argument_group("the page")
    page.add_argument(
        "--port",
        type=int,
        default=_PORT,
        help=f"where the page is served; 0 for any free port (default: {_PORT})",
    )
    only = "open no browser, only print the address"
    page.add_argument("--no-browser", action="store_true", help=only)
    page.add_argument(
        "--log",
        type=path_argument,
        metavar="FILE",
        help="write there what happens, a line of JSON per change; replaces what it held",
    )
    page.add_argument(
        "--record-folder",
        type=path_argument,
        metavar="FOLDER",
        default=Path("videos"),
        help="where videos that the page records come (default: videos)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C, the ordinary end.

    Raises
    ------
    ValueError
        There is no such thing to play, or no such port, or an option does not go with it.
    OSError
        The port is in use, or the log cannot be written.
    """
    from flyrl.validation import one_of, within  # noqa: PLC0415

    one_of("what to play", options.name, NAMES)
    if options.port != 0:
        within("--port", options.port, 1024, 65535)
    given = {name: getattr(options, name) for name in _OF_THE_FLY}
    given = {name: value for name, value in given.items() if value is not None}
    if options.name != "fly" and given:
        raise ValueError(f"--{next(iter(given))} goes with the fly only, got {options.name!r}")
    policy = given.get("policy", _PILOT)
    settings = {**given, "policy": None if policy == _NONE else policy}
    if given:  # before an address is printed; the defaults are right, and quicker unchecked
        from flyrl.play.fly_setting import PlayedFlyConfig, pilots  # noqa: PLC0415

        pilots(PlayedFlyConfig(**settings).policy)
    return serve(lambda: _make(options.name, settings), options)


def serve(make: Callable[[], Playable], options: argparse.Namespace) -> int:
    """Serve a page until Ctrl-C; return the exit status.

    Parameters
    ----------
    make
        Makes what is played, once the page is served: to import and compile it takes seconds.
    options
        Of the page, as the parser has them.

    Raises
    ------
    ValueError
        MuJoCo's web viewer is not installed.
    OSError
        It does not start, the port is in use, or the log cannot be written.
    """
    try:
        from flyrl.play import page as pages  # noqa: PLC0415
        from flyrl.play import server  # noqa: PLC0415
    except ImportError as error:
        raise ValueError(
            f"mujoco.studio, which shows the page, cannot be used ({error}); "
            "install mujoco in the version that flyrl asks for: "
            "pip install -e . in flyrl's checkout"
        ) from error

    try:
        with (
            server.listen(options.port) as listening,
            (options.log or Path(os.devnull)).open("w", encoding="utf-8") as log,
            pages.serve(listening) as play,
        ):
            address = server.url(listening)
            print(f"{options.name}: {address} (Ctrl-C ends it)", flush=True)
            from flyrl.play.recording import VideoRecorder  # noqa: PLC0415
            from flyrl.play.session import Session  # noqa: PLC0415

            with closing(VideoRecorder(options.record_folder, options.name)) as recorder:
                note = partial(print, file=log, flush=True)
                session = Session(make(), recorder, lambda entry: note(json.dumps(entry)))
                if not options.no_browser:
                    _open_browser(address)
                play(session)
    except KeyboardInterrupt:
        print()
    return 0


def _make(name: str, settings: Mapping[str, Any]) -> Playable:
    if name == "worm":
        from flyrl.play.worm import PlayedWorm  # noqa: PLC0415

        return PlayedWorm()
    from flyrl.play.fly import PlayedFly  # noqa: PLC0415
    from flyrl.play.fly_setting import PlayedFlyConfig  # noqa: PLC0415

    return PlayedFly(PlayedFlyConfig(**settings))


def _open_browser(address: str) -> None:
    has_screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if (sys.platform == "linux" and not has_screen) or not webbrowser.open(address, new=2):
        print(f"no browser can be opened here; open {address} in one", flush=True)
