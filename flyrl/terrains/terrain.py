"""The door for terrains: what a ground is made of, and how it is found by name.

A terrain is a frozen dataclass of settings, derived from `Terrain`. What it draws for an episode is
a `Ground`. x points forward at spawn. All lengths in mm, world frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Final, cast

import mujoco
import numpy as np

from flyrl.entry_points import is_entry_point, is_loaded, name_of, settings_from
from flyrl.validation import FloatArray, Within, check_fields, ordered, within

SPAWN_CLEARANCE: Final = 0.5
"""How far above a terrain's `base_height` flies are put down, mm."""

DOWN: Final = (0.0, 0.0, -1.0)
"""Where things fall to on level ground."""


@dataclass(frozen=True)
class Bounds:
    """Extent of the ground to walk on, mm.

    A fly beyond it in x or y, or below `z_min`, has left; one above `z_max` has fallen off, as from
    a wall.
    """

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    z_min: float = -5.0
    z_max: float = np.inf


@dataclass(frozen=True, eq=False)
class Boxes:
    """Axis-aligned boxes.

    Attributes
    ----------
    centres : (n, 3) mm.
    half_sizes : (n, 3) mm.
    """

    centres: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    half_sizes: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    @property
    def tops(self) -> FloatArray:
        """Height of the upper faces, (n,) mm."""
        tops: FloatArray = self.centres[:, 2] + self.half_sizes[:, 2]
        return tops

    def moved(self, offset: tuple[float, float, float]) -> Boxes:
        """All of them, moved by an offset, mm."""
        return Boxes(self.centres + offset, self.half_sizes)

    def top_at(self, x: float, y: float) -> float | None:
        """Height of the highest box at a place, mm; None where there is none."""
        inside = (np.abs(self.centres[:, :2] - (x, y)) <= self.half_sizes[:, :2]).all(axis=1)
        return float(self.tops[inside].max()) if inside.any() else None


@dataclass(frozen=True, eq=False)
class Heights:
    """A height field.

    Attributes
    ----------
    values
        Heights at the corners of square cells, mm, (rows, columns): rows along y, columns along x.
    cell
        Side of a cell, mm. The middle of the field lies at x = y = 0.
    """

    values: FloatArray
    cell: float

    @property
    def half_extent(self) -> tuple[float, float]:
        """Of the field along x and y, mm."""
        rows, columns = self.values.shape
        return (columns - 1) * self.cell / 2, (rows - 1) * self.cell / 2

    def at(self, x: FloatArray | float, y: FloatArray | float) -> FloatArray:
        """Heights at places, bilinearly; beyond the edge those of the edge."""
        rows, columns = self.values.shape
        half_x, half_y = self.half_extent
        column = np.clip((np.asarray(x) + half_x) / self.cell, 0, columns - 1)
        row = np.clip((np.asarray(y) + half_y) / self.cell, 0, rows - 1)
        i = np.minimum(row.astype(int), rows - 2)
        j = np.minimum(column.astype(int), columns - 2)
        up, right, z = row - i, column - j, self.values
        near = (1 - right) * z[i, j] + right * z[i, j + 1]
        far = (1 - right) * z[i + 1, j] + right * z[i + 1, j + 1]
        return np.asarray((1 - up) * near + up * far)


@dataclass(frozen=True, eq=False)
class Ground:
    """What one episode walks on.

    Attributes
    ----------
    boxes
        As many in every ground of a terrain and a `group`.
    shift
        Where the middle of the terrain's height field lies, mm; None: this ground has none of it.
    down
        Unit vector along which things fall: a slope is level ground with gravity turned.
    floor
        Height of the plane below everything else, mm; None: this ground has none.
    group
        Which of the terrain's `groups` of boxes these are; None: none of them.
    """

    boxes: Boxes = field(default_factory=Boxes)
    shift: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
    down: tuple[float, float, float] = DOWN
    floor: float | None = None
    group: int | None = 0


def _name(terrain: Terrain) -> str:
    return name_of(terrain, KINDS)


@dataclass(frozen=True, kw_only=True)
class Terrain:
    """Settings of a terrain; the base of every one.

    One of a user's own overrides `boxes`, `heights` or `down`, and says with `bounds`, `spawn`,
    `base_height` and `floor` where there is ground. Where its boxes are to be drawn for every
    episode (`random`), it gives a `hull` too.

    Attributes
    ----------
    name
        A built-in name, or module:attribute of a user's own.
    seed
        Of what is drawn of a ground that is the same in every episode.
    random
        Whether every episode has a ground of its own.
    """

    # a property, and a field all the same, so that `dataclasses.asdict` includes it
    name: str = field(init=False, repr=False, compare=False, default=cast(str, property(_name)))
    seed: Annotated[int, Within(0, 2**63 - 1)] = 0
    random: bool = False

    drawn_from: ClassVar[tuple[str, ...] | None] = None
    """Settings (least, greatest) of which one must differ on random ground; None: not checked."""

    def __post_init__(self) -> None:
        check_fields(self, "terrain")
        keys = self.drawn_from or ()
        ranges = [ordered(f"terrain.{key}", getattr(self, key)) for key in keys]
        if not self.random or self.drawn_from is None:
            return
        if not keys:
            raise ValueError(
                f"terrain.random: got True, but {self.name} has nothing to draw; allowed is False"
            )
        if all(least == greatest for least, greatest in ranges):
            raise ValueError(
                "terrain.random: got True, but nothing is drawn as long as "
                f"{' or '.join(keys)} is a single value; give two"
            )

    @property
    def label(self) -> str:
        """The name as tables and folders have it, with "random_" before it on random ground."""
        return terrain_label(self.name, self.random)

    @property
    def bounds(self) -> Bounds:
        """Where there is ground to walk on."""
        return Bounds(-100.0, 100.0, -100.0, 100.0)

    def sized(self, extent_mm: float | None) -> Terrain:
        """Terrain with ground as far from the start as a task needs; None: its usual size.

        A terrain whose size is set, or always the same, stays as it is.
        """
        return self

    @property
    def spawn(self) -> Bounds:
        """Where episodes start: x and y are drawn uniformly from it."""
        return Bounds(-2.0, 2.0, -2.0, 2.0)

    @property
    def base_height(self) -> float:
        """Height that spawn heights count from, mm: that of the highest ground in `spawn`."""
        return 0.0

    @property
    def floor(self) -> float | None:
        """Height of a plane below everything else, mm; None: there is none."""
        return 0.0

    def boxes(self, rng: np.random.Generator, difficulty: float) -> Boxes:
        """Draw the boxes of a ground, as many each time.

        Parameters
        ----------
        rng
            Of this ground alone.
        difficulty
            From 0 (the easiest) to 1 (as the settings say).
        """
        return Boxes()

    @property
    def groups(self) -> tuple[slice, ...]:
        """Boxes of the hull of which a ground has one group or none; (): it has them all."""
        return ()

    def hull(self) -> Boxes:
        """Boxes of which each holds its like in every ground that can be drawn.

        MuJoCo works out at compile time where to look for contacts.
        """
        raise ValueError(
            f"terrain.random: {self.name} must define hull() for grounds that differ, got none"
        )

    def heights(self) -> Heights | None:
        """Height field, the same in every episode; see `shift`."""
        return None

    def shift(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """Draw where the middle of the height field lies in a ground, mm."""
        return (0.0, 0.0, 0.0)

    def down(self, rng: np.random.Generator, difficulty: float) -> tuple[float, float, float]:
        """Draw the unit vector along which things fall."""
        return DOWN

    @property
    def is_rough(self) -> bool:
        """Whether there is more to it than a plane."""
        return self.heights() is not None or bool(len(self.compiled().boxes.centres))

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add to a scene what is neither box, height field nor plane.

        What touches a fly has contype `flyrl.bodies.fly.BOXES`, conaffinity 0, and a name that
        begins with "ground".
        """

    def draw(self, seed: int, difficulty: float = 1.0) -> Ground:
        """Draw a ground.

        Parameters
        ----------
        seed
            The same seed gives the same bits; the terrain's own `seed` has no say. A terrain that
            is not random is `draw(terrain.seed)`.
        difficulty
            From 0 (the easiest) to 1 (as the settings say).

        Raises
        ------
        ValueError
            If the difficulty is out of its range.
        """
        within("difficulty", difficulty, 0, 1)
        rng = np.random.default_rng(seed)
        return Ground(
            self.boxes(rng, difficulty), self.shift(rng), self.down(rng, difficulty), self.floor
        )

    def compiled(self) -> Ground:
        """Ground that a scene is compiled with: on random terrain with the `hull`."""
        usual = self.draw(self.seed)
        if not self.random or not len(usual.boxes.centres):
            return usual
        return replace(usual, boxes=off_origin(self.hull()))

    def top_at(self, ground: Ground, x: float, y: float) -> float | None:
        """Height of what one walks on at a place, mm; None over a gap, and where there is none."""
        tops = [ground.boxes.top_at(x, y)]
        if ground.shift is not None and (heights := self.heights()) is not None:
            left, forth, up = ground.shift
            tops.append(up + float(heights.at(x - left, y - forth)))
        elif not len(ground.boxes.centres):
            tops.append(ground.floor)
        found = [top for top in tops if top is not None]
        return max(found) if found else None


def joined(several: Iterable[Boxes]) -> Boxes:
    """All boxes of several, in their order."""
    every = [Boxes(), *several]
    return Boxes(
        np.concatenate([boxes.centres for boxes in every]),
        np.concatenate([boxes.half_sizes for boxes in every]),
    )


def off_origin(boxes: Boxes) -> Boxes:
    """Boxes of which none lies at the world's origin: MuJoCo would keep it there."""
    nudge = 1e-6 * (np.abs(boxes.centres) < 1e-9).all(axis=1, keepdims=True)
    return Boxes(boxes.centres + nudge, boxes.half_sizes + nudge)


KINDS: Final[dict[str, type[Terrain]]] = {}
"""Classes of the built-in terrains by name; `flyrl.terrains` fills it."""

TERRAINS: Final[dict[str, Terrain]] = {}
"""Terrains that go by a name; `flyrl.terrains` fills it."""


def terrain_named(name: str) -> Terrain:
    """Terrain of a name, built-in or module:attribute, with its usual settings.

    Raises
    ------
    ValueError
        If there is no such terrain.
    """
    return terrain_from(name)


def terrain_from(given: str | Mapping[str, Any] | Terrain, key: str = "terrain") -> Terrain:
    """Terrain of a name, or of what `dataclasses.asdict` made of it; a terrain stays as it is.

    Settings of other terrains, which old records hold, are ignored.

    Raises
    ------
    ValueError
        If there is no such terrain, setting or value, or no name.
    """
    return settings_from(key, given, KINDS, Terrain, _FORMER_FIELDS, TERRAINS)


def terrain_on_record(record: Any) -> Terrain | None:
    """Terrain of a record, without running anybody's code.

    None where it cannot be made: of a user's own terrain whose module is not loaded, and of a
    record that another version wrote.
    """
    name = record.get("name") if isinstance(record, Mapping) else None
    if not isinstance(name, str) or (is_entry_point(name) and not is_loaded(name)):
        return None
    try:
        return terrain_from(record)
    except (TypeError, ValueError):
        return None


def terrain_label(name: object, random: object) -> str:
    """Name of a terrain in tables and folders; a record of old says nothing of `random`."""
    label = str(name).rpartition(":")[2]
    is_always_so = getattr(KINDS.get(label), "random", False)
    return f"random_{label}" if random is True and not is_always_so else label


_FORMER_FIELDS: Final = ("height_range", "gap_range")
"""Settings that records held of every terrain, whether it used them or not."""
