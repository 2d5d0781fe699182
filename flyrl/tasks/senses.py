"""What a fly feels of itself: the observation terms that every steering task shares.

It measures its velocity, yaw rate and tilt, with noise if asked for. Drive, phases, magnitudes and
reflexes are its own commands, and legs are on the ground or not.
"""

from operator import attrgetter
from typing import Final

from flyrl.tasks import terms
from flyrl.tasks.actions import DRIVE_HIGH, DRIVE_LOW
from flyrl.tasks.task import ObservationTerm

MUSCLE_TENSIONS: Final = ObservationTerm(
    "muscle_tensions", (84,), 0.0, 1.0, attrgetter("fly.muscle_tensions"),
    "share of their strength that the legs' muscles exert", spread=0.1,
)  # fmt: skip
"""Not among the senses below, since most flies have servos; add it to a task of a fly with muscles:
task.terms=[flyrl.tasks.senses:MUSCLE_TENSIONS]."""

SENSES: Final = (
    ObservationTerm(
        "velocity", (2,), -5.0, 5.0, terms.velocity_b,
        "forward and leftward velocity of the thorax, in 20 mm/s", spread=0.4,
    ),
    ObservationTerm(
        "heading_rate", (1,), -5.0, 5.0, terms.heading_rate, "yaw rate, in 10 rad/s", spread=0.5
    ),
    ObservationTerm(
        "tilt", (2,), -1.0, 1.0, terms.tilt_b,
        "x and y of the world's up direction in the thorax frame; 0 when level", spread=0.05,
    ),
    ObservationTerm(
        "drive", (2,), DRIVE_LOW, DRIVE_HIGH, attrgetter("fly.command"),
        "drive of the last decision",
    ),
    ObservationTerm(
        "phases", (12,), -1.0, 1.0, terms.phase_vectors,
        "cosines, then sines, of the six legs' CPG phases",
    ),
    ObservationTerm(
        "magnitudes", (6,), 0.0, 2.0, attrgetter("fly.magnitudes"),
        "the six legs' CPG magnitudes",
    ),
    ObservationTerm(
        "contacts", (6,), 0.0, 1.0, terms.leg_contacts, "1 for each leg on the ground"
    ),
    ObservationTerm(
        "reflexes", (12,), 0.0, 1.0, terms.reflexes,
        "correction amounts, in 80: six of retraction, six of stumbling",
    ),
)  # fmt: skip
