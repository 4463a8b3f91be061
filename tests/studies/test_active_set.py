"""RK4 keeps its order while the same constraints act throughout; it is switching that costs it."""

import pytest

from studies.active_set import CONSTANT, active_sets, order

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", CONSTANT)
@pytest.mark.parametrize(("integrator", "expected"), [("RK4", 4), ("Euler", 1)])
def test_the_order_of_a_scene_whose_constraints_act_throughout(name: str, integrator: str, expected: int) -> None:
    assert order(name, integrator) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("name", CONSTANT)
def test_their_active_set_is_constant(name: str) -> None:
    (rows,) = active_sets(name)
    assert rows


@pytest.mark.parametrize("name", ["joint_limits", "cube"])
def test_that_of_the_scenes_of_first_order_switches(name: str) -> None:
    assert len(active_sets(name)) > 1
