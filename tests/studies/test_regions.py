"""Stability regions: closed forms of the limit, of the growth and MuJoCo's own step agree, and simulation with them."""

from cmath import rect
from math import isinf, radians

import pytest

from grader.numerics.integrators import BY_NAME
from grader.studies.bench.physics import regions


@pytest.mark.parametrize("integrator", BY_NAME)
@pytest.mark.parametrize("angle", regions.ANGLES)
def test_growth_is_1_where_the_limit_is(integrator: str, angle: int) -> None:
    end = regions.find_limit(integrator, angle)
    if integrator == "discrete":
        assert isinf(end)
        assert all(
            regions.compute_growth(integrator, rect(radius, radians(angle))) < 1 for radius in (0.01, 1.0, 100.0)
        )
    else:
        assert regions.compute_growth(integrator, rect(end, radians(angle))) == pytest.approx(1, abs=1e-9)
        assert regions.compute_growth(integrator, rect(0.99 * end, radians(angle))) < 1
        assert regions.compute_growth(integrator, rect(1.01 * end, radians(angle))) > 1


@pytest.mark.parametrize("integrator", BY_NAME)
def test_simulation_and_mujocos_own_step_agree_with_the_closed_form(integrator: str) -> None:
    points = regions.Ray(integrator, 135).measure(True, {})["points"]
    assert {point["inside"] for point in points} == ({True} if integrator == "discrete" else {True, False})
    for point in points:
        assert point["closed"] == pytest.approx(point["spectral"], rel=1e-9)
        assert point["grows"] is not point["inside"]


def test_the_eigenvalue_of_a_servo_is_a_root_of_its_equation() -> None:
    for servo in regions.SERVOS.values():
        z = regions.compute_eigenvalue(servo)
        assert abs(servo.inertia * z * z + servo.kv * z + servo.stiffness) < 1e-9 * servo.stiffness
        assert z.imag > 0 > z.real
