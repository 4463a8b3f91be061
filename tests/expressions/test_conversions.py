"""Many values at once are converted as each alone is."""

import numpy as np
import pytest

from grader.expressions import UNDEFINED, Value, to_number, to_numbers

MIXED: list[Value] = [1.5, True, False, None, UNDEFINED, "0x10", " 2 ", "two", [3.0], [1.0, 2.0], -0.0]


@pytest.mark.parametrize("column", [MIXED, [0.1, -0.0, float("inf")], (), [True], [[1.0], [2.0]]])
def test_a_column_is_converted_value_by_value(column: list[Value]) -> None:
    numbers = to_numbers(column)
    assert numbers.shape == (len(column),)
    assert numbers.tobytes() == np.array([to_number(value) for value in column], dtype=np.float64).tobytes()
