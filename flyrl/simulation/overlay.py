"""What pictures show beside the body itself."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Overlay:
    """What is drawn into pictures; each can be switched off. The defaults are those of videos.

    Attributes
    ----------
    target
        A marker on the target, where there is one.
    leg_colours
        Tarsi coloured while they grip, tibiae on retraction, femora on stumbling. Of flies.
    trace
        The thorax's path, as a ribbon on the ground. Of flies.
    forces
        An arrow at every foot, of the ground's force on the leg. Of flies. A gripping leg pulls
        itself to the ground, so its arrow is mostly that of its grip.
    scale_bar
        A bar of a round length, as long as it would be at the body's distance.
    clock
        Simulated time, and how fast it plays.
    """

    target: bool = True
    leg_colours: bool = True
    trace: bool = True
    forces: bool = False
    scale_bar: bool = True
    clock: bool = True


PLAIN: Final = Overlay(leg_colours=False, trace=False, scale_bar=False, clock=False)
"""The body, and its target."""

EVERYTHING: Final = Overlay(forces=True)
