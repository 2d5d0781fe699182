import numpy as np
import pytest

from flyrl.policies.networks import vectors


def test_an_array_stays_as_it_is():
    np.testing.assert_array_equal(vectors([[1, 2], [3, 4]]), [[1.0, 2.0], [3.0, 4.0]])


def test_parts_of_a_dict_stand_side_by_side_in_the_order_of_their_names():
    parts = {"b": np.array([[3.0], [6.0]]), "a": np.array([[1, 2], [4, 5]], np.float32)}
    np.testing.assert_array_equal(vectors(parts), [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(vectors({"b": [3.0], "a": [1.0]}), [1, 3])


def test_parts_of_different_batches_are_refused():
    with pytest.raises(ValueError, match="must match exactly"):
        vectors({"a": np.zeros((2, 1)), "b": np.zeros((3, 1))})
