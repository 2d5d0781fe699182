"""flyrl walk: let a fly walk, and keep what it did."""

from __future__ import annotations

import argparse
from typing import Final

from flyrl.cli.terminal import Subparsers, path_argument, settings_argument

_PARTS: Final = {
    "controller": "what moves the legs: a name, or settings with one, '{name: cpg, gait: wave}'; "
    "so are terrain, physics and body",
    "terrain": "what it walks on (default: flat)",
    "physics": "preset of the physics",
    "body": "which fly",
}
_SETTINGS: Final = ("drive", "seconds", "every", "seed")
_TABLES: Final = ("csv", "npz", "parquet", "nwb")
"""Kinds of files that a walk's table can go to, by their suffix."""
_OUTPUTS: Final = {
    "csv": "write the table there, as CSV",
    "npz": "write the table there, as NumPy's arrays",
    "parquet": "write the table there, as Parquet (needs pyarrow)",
    "nwb": "write the table there, as Neurodata Without Borders (needs pynwb)",
    "plot": "draw it there: .png, .svg or .pdf",
    "video": "write an MP4 there",
}


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "walk",
        help="let a fly walk, and keep it as a table and a video",
        description="Let a fly walk under a steady drive, or replay joint angles.",
        epilog="example: flyrl walk --controller cpg --drive 1 1 --seconds 1 --video walk.mp4 "
        "--csv walk.csv",
    )
    for part, about in _PARTS.items():
        parser.add_argument(f"--{part}", type=settings_argument, metavar="NAME", help=about)
    parser.add_argument("--drive", nargs=2, type=float, metavar=("LEFT", "RIGHT"))
    parser.add_argument("--seconds", type=float, help="simulated time")
    parser.add_argument("--every", type=float, default=1e-3, help="s between two rows of the table")
    parser.add_argument("--seed", type=int, default=0, help="of start and phases")
    parser.add_argument(
        "--joints",
        type=path_argument,
        metavar="FILE",
        help="replay a recording, without controller, drive and seconds: a CSV with a column per "
        "joint (joint_LFCoxa, …), rad, and adhesion_LF, …; or an NPZ with joints (T, 42) and "
        "adhesion (T, 6)",
    )
    parser.add_argument("--rate-hz", type=float, help="samples per second of the recording")
    for output, about in _OUTPUTS.items():
        parser.add_argument(f"--{output}", type=path_argument, metavar="FILE", help=about)
    parser.add_argument(
        "--camera", choices=("follow", "top"), default="follow", help="from where it is filmed"
    )
    parser.set_defaults(run=run, terrain="flat")


def run(options: argparse.Namespace) -> int:
    """Walk, write what is asked for, and say how far the fly came.

    Raises
    ------
    ValueError
        A value that is not allowed, or a recording that is none.
    OSError
        A file that cannot be read or written.
    """
    from flyrl.front.recordings import load_recording  # noqa: PLC0415
    from flyrl.front.walks import walk  # noqa: PLC0415

    for option in (*_TABLES, "video"):
        path, suffix = getattr(options, option), ".mp4" if option == "video" else f".{option}"
        if path is not None and path.suffix != suffix:
            raise ValueError(f"--{option} must name a file that ends in {suffix}, got {path}")
    given = {name: getattr(options, name) for name in (*_PARTS, *_SETTINGS)}
    if options.joints is not None:
        given |= {**load_recording(options.joints), "rate_hz": options.rate_hz}
    walked = walk(**given)
    for path in filter(None, (getattr(options, suffix) for suffix in _TABLES)):
        print(f"table: {walked.save(path)}")
    if options.plot is not None:
        walked.plot().savefig(options.plot)
        print(f"plot: {options.plot}")
    if options.video is not None:
        print(f"video: {walked.video(options.video, options.camera)}")
    table = walked.frame()
    first, last = table.iloc[0], table.iloc[-1]
    print(
        f"{last.time_s - first.time_s:.3g} s, {last.x_mm - first.x_mm:.2f} mm along x, "
        f"{last.y_mm - first.y_mm:.2f} mm along y: {walked.outcome}"
    )
    return 0
