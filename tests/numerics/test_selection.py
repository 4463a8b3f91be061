"""The choice of integrator and timestep, by measured error."""

import mujoco
import pytest

from grader.numerics.integrators import EULER, IMPLICITFAST, RK4
from grader.numerics.scene import Scene
from grader.numerics.selection import TIMESTEPS_S, Quantity, named, select
from numerics.models import ALL, DELAY, LESSON, RUNAWAY, hinge

pytestmark = pytest.mark.slow

DOUBLE = Scene.from_xml(LESSON["double_pendulum"], key="release")


def test_accuracy_on_an_energy_conserving_scene_is_cheapest_with_rk4() -> None:
    chosen = select(DOUBLE, tolerance=1e-5, seconds=1.0)
    assert chosen.best is not None
    assert chosen.best.integrator == RK4
    assert chosen.margin >= 1
    assert chosen.best.error * chosen.margin == pytest.approx(1e-5)
    assert "RK4" in chosen.reason


def test_the_choice_is_the_cheapest_that_passes() -> None:
    chosen = select(DOUBLE, tolerance=1e-5, seconds=1.0)
    assert chosen.best is not None
    cheaper = [c for c in chosen.candidates if c.cost < chosen.best.cost]
    assert cheaper
    assert all(c.error > 1e-5 for c in cheaper)


def test_a_loose_tolerance_takes_a_single_step_method() -> None:
    chosen = select(Scene.from_xml(LESSON["pendulum_servo"]).at(qpos=[0.1]), tolerance=0.02, seconds=1.0)
    assert chosen.best is not None
    assert chosen.best.integrator == IMPLICITFAST


def test_a_quantity_of_ones_own_is_what_counts() -> None:
    def height(_model: mujoco.MjModel, data: mujoco.MjData) -> float:
        return float(data.site("tip").xpos[2])

    chosen = select(DOUBLE, tolerance=1e-5, seconds=0.5, quantity=height)
    by_angle = select(DOUBLE, tolerance=1e-5, seconds=0.5)
    assert chosen.best is not None and by_angle.best is not None
    assert chosen.best.error <= 1e-5
    assert {c.error for c in chosen.candidates} != {c.error for c in by_angle.candidates}


def test_it_says_so_when_nothing_is_good_enough() -> None:
    chosen = select(DOUBLE, tolerance=1e-7, seconds=1.0, integrators=(EULER,))
    assert chosen.best is None
    assert "none of the candidates" in chosen.reason


def test_it_says_so_when_it_cannot_tell() -> None:
    chaotic = select(DOUBLE, tolerance=1e-6, seconds=12.0, integrators=(RK4,), timesteps_s=(0.002,))
    assert chaotic.best is None
    assert chaotic.reason.startswith("cannot tell")
    touching = select(Scene.from_xml(ALL["cube"]), tolerance=1e-9, seconds=0.5, timesteps_s=(0.002, 0.001))
    assert touching.best is None
    assert touching.reason.startswith("cannot tell")


def test_a_pass_by_accident_does_not_count() -> None:
    """Every smaller timestep that was tried must pass too."""
    chosen = select(DOUBLE, tolerance=1e-5, seconds=1.0)
    assert chosen.best is not None
    finer = [h for h in TIMESTEPS_S if h < chosen.best.timestep_s]
    of_same = {c.timestep_s: c.error for c in chosen.candidates if c.integrator == chosen.best.integrator}
    assert all(of_same[h] <= 1e-5 for h in finer)


def test_the_same_choice_every_time() -> None:
    assert select(DOUBLE, tolerance=1e-4, seconds=0.2) == select(DOUBLE, tolerance=1e-4, seconds=0.2)


@pytest.mark.parametrize(
    ("tolerance", "seconds"), [(0, 1), (-1, 1), (float("nan"), 1), (1e-3, 0), (1e-3, float("inf"))]
)
def test_meaningless_questions_are_refused(tolerance: float, seconds: float) -> None:
    with pytest.raises(ValueError, match="tolerance"):
        select(DOUBLE, tolerance=tolerance, seconds=seconds)


def test_names_are_spelt_as_in_the_lesson() -> None:
    chosen = select(DOUBLE, tolerance=1e-4, seconds=0.1)
    spoken = {named(c).split(" at ")[0] for c in chosen.candidates}
    assert spoken == {"Euler", "RK4", "implicit", "implicitfast", "discrete"}


@pytest.mark.parametrize("quantity", [None, lambda _model, data: float(data.qpos[0])])
def test_timesteps_must_divide_the_samples(quantity: Quantity | None) -> None:
    with pytest.raises(ValueError, match="divide"):
        select(DOUBLE, tolerance=1e-2, seconds=0.2, quantity=quantity, timesteps_s=(0.003,))


def test_a_run_of_too_many_steps_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match="may last 500 s"):
        select(DOUBLE, tolerance=1e-2, seconds=1e9)


@pytest.mark.parametrize(("scene", "why"), [(RUNAWAY, "without bound"), (DELAY, "delay")])
def test_what_has_no_reference_cannot_be_told(scene: str, why: str) -> None:
    moving = Scene.from_xml(scene).at(qpos=[0.1], qvel=[1e8 if scene is RUNAWAY else 0])
    chosen = select(moving, tolerance=1e-2, seconds=0.2)
    assert (chosen.best, chosen.candidates) == (None, ())
    assert chosen.reason.startswith("cannot tell")
    assert why in chosen.reason


def test_limited_activations_are_held_against_fine_steps() -> None:
    """DOP853 would go on beyond the limit, which the activation reaches after 0.1 s."""
    integrator = "<intvelocity joint='hinge' kp='3' actrange='-.1 .1'/>"
    limited = Scene.from_xml(hinge("damping='.5'", rest=f"<actuator>{integrator}</actuator>")).at(ctrl=[1])
    chosen = select(limited, tolerance=1e-2, seconds=0.5, timesteps_s=(0.001, 0.002))
    assert chosen.best is not None
