import numpy as np
import pytest

from flyrl.simulation.randomisation import UNVARIED, Randomisation, RandomisationConfig

FACTORS = ("friction", "mass", "actuator_gain", "adhesion")


def test_without_ranges_every_fly_is_the_scenes_own() -> None:
    assert RandomisationConfig().draw(3) == UNVARIED == Randomisation(1, 1, 1, 1, 0, 0)


def test_noise_needs_no_range() -> None:
    assert RandomisationConfig(sensor_noise=0.1).draw(3) == Randomisation(sensor_noise=0.1)


def test_draws_are_the_first_of_the_seeds_own_stream() -> None:
    friction, *_, latency = np.random.default_rng([8, 171_006_537]).random(5)
    drawn = RandomisationConfig(friction=(0.5, 1.5), drive_latency=(0.0, 0.05)).draw(8)
    assert drawn == Randomisation(friction=0.5 + friction, drive_latency=0.05 * latency)


def test_a_range_of_one_value_gives_this_value() -> None:
    config = RandomisationConfig((0.5, 0.5), (2, 2), (0.3, 0.3), (0, 0), 0.2, (0.05, 0.05))
    assert config.draw(11) == Randomisation(0.5, 2.0, 0.3, 0.0, 0.2, 0.05)


@pytest.mark.parametrize("name", [*FACTORS, "drive_latency"])
def test_draws_are_uniform_in_their_range(name: str) -> None:
    low, high = (0.01, 0.03) if name == "drive_latency" else (0.5, 2.0)
    config = RandomisationConfig(**{name: (low, high)})
    values = np.array([getattr(config.draw(seed), name) for seed in range(2000)])
    assert low <= values.min() < values.max() <= high
    deciles = np.histogram(values, bins=10, range=(low, high))[0]
    # 200 in each but for chance, whose standard deviation is 13
    assert np.abs(deciles - 200).max() < 60


def test_a_range_changes_no_draw_but_its_own() -> None:
    both = RandomisationConfig(friction=(0.5, 1.5), drive_latency=(0.0, 0.05)).draw(8)
    assert both.friction == RandomisationConfig(friction=(0.5, 1.5)).draw(8).friction
    assert both.drive_latency == RandomisationConfig(drive_latency=(0, 0.05)).draw(8).drive_latency
    assert both.mass == 1.0


def test_quantities_are_drawn_independently() -> None:
    config = RandomisationConfig(**dict.fromkeys(FACTORS, (0.5, 1.5)))
    drawn = [[getattr(config.draw(seed), name) for name in FACTORS] for seed in range(500)]
    correlations = np.corrcoef(np.array(drawn).T) - np.eye(4)
    assert np.abs(correlations).max() < 0.2


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"friction": (1.2, 0.8)}, r"randomisation\.friction must be \(least, greatest\), got \(1"),
        ({"friction": (-0.1, 1)}, r"randomisation\.friction\[0\] .* from 0 to 100, got -0\.1"),
        ({"mass": (0.0, 1.0)}, r"randomisation\.mass\[0\] must .* from 0\.01 to 100, got 0\.0"),
        ({"mass": 1.5}, r"randomisation\.mass must be a tuple, got 1\.5"),
        ({"adhesion": (1, 2, 3)}, r"randomisation\.adhesion must be a tuple of 2, got \(1, 2, 3\)"),
        (
            {"actuator_gain": (0.5, np.inf)},
            r"randomisation\.actuator_gain\[1\] must be",
        ),
        ({"sensor_noise": -1.0}, r"randomisation\.sensor_noise must .* from 0 to 100, got -1\.0"),
        ({"drive_latency": (0, 0.06)}, r"drive_latency\[1\] must be .* from 0 to 0\.05, got 0\.06"),
    ],
)
def test_what_is_not_allowed_is_refused(settings: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RandomisationConfig(**settings)  # type: ignore[arg-type]
