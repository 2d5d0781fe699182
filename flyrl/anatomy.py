"""Names and canonical orders of the fly's legs, joints and segments.

Every array in flyrl that has a leg, joint or segment axis follows these orders.
"""

from typing import Final, Literal

Leg = Literal["LF", "LM", "LH", "RF", "RM", "RH"]

LEGS: Final[tuple[Leg, ...]] = ("LF", "LM", "LH", "RF", "RM", "RH")
"""Left then right; front, middle, hind."""

LEG_DOFS: Final = ("Coxa", "Coxa_roll", "Coxa_yaw", "Femur", "Femur_roll", "Tibia", "Tarsus1")
"""Actuated degrees of freedom of one leg; an unmarked name is the pitch joint."""

JOINTS: Final = tuple(f"joint_{leg}{dof}" for leg in LEGS for dof in LEG_DOFS)
"""The 42 actuated joints, leg-major."""

LEG_SEGMENTS: Final = (
    "Coxa",
    "Femur",
    "Tibia",
    "Tarsus1",
    "Tarsus2",
    "Tarsus3",
    "Tarsus4",
    "Tarsus5",
)

SENSED_SEGMENTS: Final = LEG_SEGMENTS[2:]
"""Segments of one leg that sense contact."""

CONTACT_SEGMENTS: Final = tuple(f"{leg}{segment}" for leg in LEGS for segment in SENSED_SEGMENTS)
"""The 36 contact-sensing segments, leg-major."""

STUMBLING_SEGMENTS: Final = ("Tibia", "Tarsus1", "Tarsus2")
"""Segments whose contact against the heading counts as stumbling."""

END_EFFECTORS: Final = tuple(f"{leg}Tarsus5" for leg in LEGS)

PASSIVE_TARSUS_JOINTS: Final = tuple(
    f"joint_{leg}Tarsus{segment}" for leg in LEGS for segment in range(2, 6)
)

TRIPODS: Final[tuple[tuple[Leg, ...], ...]] = (("LF", "LH", "RM"), ("LM", "RF", "RH"))
"""The two leg groups that swing together in the tripod gait."""

RIGHT_LEG_MIRROR: Final = (1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0)
"""Sign of each degree of freedom under left-right reflection, ordered as LEG_DOFS."""
