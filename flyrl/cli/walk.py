"""flyrl walk: let a fly walk, and keep what it did."""

from __future__ import annotations

import argparse
from typing import Any, Final

from flyrl.cli.terminal import Subparsers, path_argument, settings_argument

_FILES: Final = {
    "csv": "CSV",
    "npz": "NumPy's arrays",
    "parquet": "Parquet (needs pyarrow)",
    "nwb": "Neurodata Without Borders (needs pynwb)",
}
"""Kinds of files that a walk's table can go to, by their suffix."""


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "walk",
        help="let a fly walk, and keep it as a table and a video",
        description="Let a fly walk under a steady drive, or replay joint angles.",
        epilog="example: flyrl walk --controller cpg --drive 1 1 --seconds 1 --video walk.mp4 "
        "--csv walk.csv",
    )
    named: dict[str, Any] = {"type": settings_argument, "metavar": "NAME"}
    parser.add_argument(
        "--controller",
        **named,
        help="what moves the legs: a name, or settings with one, '{name: cpg, gait: wave}'; so are "
        "terrain, physics and body",
    )
    parser.add_argument("--drive", nargs=2, type=float, metavar=("LEFT", "RIGHT"))
    parser.add_argument("--terrain", default="flat", **named, help="what it walks on")
    parser.add_argument("--physics", **named, help="preset of the physics")
    parser.add_argument("--body", **named, help="which fly")
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
    for suffix, kind in _FILES.items():
        parser.add_argument(
            f"--{suffix}",
            type=path_argument,
            metavar="FILE",
            help=f"write the table there, as {kind}",
        )
    parser.add_argument(
        "--plot", type=path_argument, metavar="FILE", help="draw it there: .png, .svg or .pdf"
    )
    parser.add_argument("--video", type=path_argument, metavar="FILE", help="write an MP4 there")
    parser.add_argument(
        "--camera", choices=("follow", "top"), default="follow", help="from where it is filmed"
    )
    parser.set_defaults(run=run)


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

    files = {suffix: getattr(options, suffix) for suffix in _FILES}
    kinds = [(suffix, suffix, path) for suffix, path in files.items()]
    for option, suffix, path in (*kinds, ("video", "mp4", options.video)):
        if path is not None and path.suffix != f".{suffix}":
            raise ValueError(f"--{option} must name a file that ends in .{suffix}, got {path}")
    recording: dict[str, Any] = {}
    if options.joints is not None:
        recording = {**load_recording(options.joints), "rate_hz": options.rate_hz}
    walked = walk(
        options.controller,
        options.drive,
        terrain=options.terrain,
        seconds=options.seconds,
        every=options.every,
        seed=options.seed,
        physics=options.physics,
        body=options.body,
        **recording,
    )
    for path in filter(None, files.values()):
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
