"""Actions and what they command, worked out by hand."""

import numpy as np
import pytest

from flyrl.tasks import Drives, Neurons
from flyrl.tasks.actions import action_vectors

POOLS = (16, 5, 1)


def test_the_range_of_drives_is_that_of_actions_stretched() -> None:
    # from [-0.5, 1.5] to [0, 4]: 2 per unit of drive
    actions = Drives(0.0, 4.0)
    drives = np.array([[-0.5, 1.5], [0.5, 0.0]])
    np.testing.assert_allclose(actions.of(drives), [[0.0, 4.0], [2.0, 1.0]])
    np.testing.assert_allclose(actions.commands(actions.of(drives)), drives)


def test_drives_beyond_their_range_are_clipped() -> None:
    np.testing.assert_allclose(Drives().commands([-3.0, 1.1]), [-0.5, 1.5])
    assert Drives().size == 2


@pytest.mark.parametrize("wrong", [0.5, np.nan, -1e-9, 5, -1])
def test_numbers_that_are_no_neurons_of_their_pool_are_refused(wrong) -> None:
    with pytest.raises(ValueError, match=r"must be whole numbers from 0 to \[15, 4, 0\], got \[1"):
        Neurons(POOLS).commands([1.0, wrong, 0.0])


def test_continuous_actions_go_to_the_nearest_neuron() -> None:
    # of 16: 7.5 (n + 1), so 0.2 gives the neuron 9; of 5: 2 (n + 1), so 0.2 gives 2.4
    neurons = Neurons(POOLS, is_integer=False)
    np.testing.assert_array_equal(neurons.of([[0, 0, 0], [15, 4, 0]]), [[-1, -1, -1], [1, 1, -1]])
    np.testing.assert_array_equal(neurons.commands([0.2, 0.2, 0.2]), [9, 2, 0])
    np.testing.assert_array_equal(neurons.commands([-1, 1, 1]), [0, 4, 0])
    np.testing.assert_array_equal(neurons.commands([7, -7, -7]), [15, 0, 0])


@pytest.mark.parametrize("is_integer", [True, False])
def test_every_neuron_has_an_action_that_commands_it(is_integer: bool) -> None:
    neurons = Neurons((16, 301), is_integer)
    every = np.stack([np.minimum(np.arange(301), 15), np.arange(301)], axis=1)
    np.testing.assert_array_equal(neurons.commands(neurons.of(every)), every)
    # to the bit also after rounding to what a policy gives
    np.testing.assert_array_equal(neurons.commands(neurons.of(every).astype(np.float32)), every)


@pytest.mark.parametrize("pools", [(), (3, 0)])
def test_pools_without_neurons_are_refused(pools: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="pools must be numbers of neurons above 0, got"):
        Neurons(pools)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"joints": np.zeros(41)}, "'joints'. must have shape .42,., got shape .41,."),
        ({"adhesion": np.ones(5)}, "'adhesion'. must have shape .6,., got shape .5,."),
        ({"adhesion": np.full(6, 2)}, r"action\['adhesion'\] must be at most 1, got 2.0"),
        ({"adhesion": None}, "action must have 'joints' and 'adhesion', got joints"),
        ({"adhesions": 1}, "action has no 'adhesions'; did you mean 'adhesion'"),
    ],
)
def test_what_is_wrong_in_a_dict_is_refused_by_name(changed, message):
    action = {"joints": np.zeros(42), "adhesion": np.ones(6), **changed}
    with pytest.raises(ValueError, match=message):
        action_vectors({name: value for name, value in action.items() if value is not None})


def test_dicts_of_many_flies_become_rows() -> None:
    rows = action_vectors({"joints": np.zeros((3, 42)), "adhesion": np.ones((3, 6))})
    np.testing.assert_array_equal(rows, [[0.0] * 42 + [1.0] * 6] * 3)
