"""flyrl figures: draw the literature's figures."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Final

from flyrl.cli.terminal import Subparsers, path_argument

FIGURES: Final = {
    "cpg_three": "phases and magnitudes of three coupled oscillators",
    "cpg_tripod": "the six legs' oscillators in a tripod gait",
    "steps": "the 42 joint angles of both recorded steps, swing shaded",
    "steps_magnitude": "the same, with the magnitude growing from 0 to 1",
    "adhesion": "when each leg grips, over the phase of its step",
    "rules_graph": "the legs' influences on each other",
    "rules": "the legs' phases under the rules and their scores, swing shaded",
    "terrains": "the four terrains with a fly on each (picture)",
    "turn": "the oscillators in a turn",
    "gaits": "three gaits of the CPG: which legs stand, and their speed",
    "slopes": "slope at which a fly falls, by adhesion, beside the published medians",
    "comparison": "CPG, rules and hybrid on the terrains, 20 episodes each (1 to 2 minutes)",
    "muscle": "a motor pool and its recruitment curve",
    "walk_cpg_without_adhesion": "the CPG on legs that do not grip (video)",
    "walk_cpg": "the CPG on legs that grip, tarsi coloured meanwhile (video)",
    "walk_rules": "the rule-based controller (video)",
    "walk_hybrid": "the hybrid controller on mixed ground, reflexes coloured (video)",
    "turn_video": "a turn seen from above (video)",
    "worm": "a worm in mid air recruits its muscle (video)",
}
"""Name of each figure and its description."""


def add_to(subparsers: Subparsers) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "figures",
        help="draw the literature's figures",
        description="Draw figures and videos of the literature, each with a CSV file of the "
        "numbers that it shows. Without names, all of them.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="figures:\n"
        + "\n".join(f"  {name:27}{text}" for name, text in FIGURES.items())
        + "\n\nVideos and the picture need a GL library; without one they are left out."
        + "\n\nexample:\n  flyrl figures cpg_tripod turn",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="which (default: all)")
    folder: dict[str, Any] = {"type": path_argument, "default": Path("figures")}
    parser.add_argument("--output", **folder, help="folder where they go (default: figures)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Draw them; the status is 1 if one could not be drawn, which stops no other.

    Raises
    ------
    ValueError
        There is no such figure.
    OSError
        The folder cannot be made.
    """
    from flyrl.progress import progress_bar  # noqa: PLC0415
    from flyrl.report.gallery import GALLERY, write  # noqa: PLC0415
    from flyrl.simulation.rendering import RenderingUnavailableError  # noqa: PLC0415
    from flyrl.validation import one_of  # noqa: PLC0415

    names = [one_of("figure", name, FIGURES) for name in options.names] or list(FIGURES)
    options.output.mkdir(parents=True, exist_ok=True)
    left_out: dict[str, list[str]] = {}
    with progress_bar(len(names), is_shown=True, unit="figure", description="drawing") as bar:
        for name in names:
            bar.set_postfix_str(name)
            try:
                write(GALLERY[name](), options.output, name)
            except (RenderingUnavailableError, RuntimeError, OSError) as error:
                left_out.setdefault(" ".join(str(error).split()), []).append(name)
            bar.update()
    for reason, without in left_out.items():
        print(f"left out: {', '.join(without)}: {reason}", file=sys.stderr)
    print(f"figures: {options.output}")
    return 1 if left_out else 0
