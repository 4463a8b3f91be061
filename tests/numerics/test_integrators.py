"""The table of integrators against MuJoCo itself."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import get_args

import mujoco
import pytest

from grader.domain.verify import IntegratorName
from grader.numerics.accuracy.convergence import fit_order
from grader.numerics.accuracy.reference import list_sample_times, solve_dop853
from grader.numerics.integrators import (
    BY_CODE,
    BY_NAME,
    DISCRETE,
    EULER,
    IMPLICIT,
    IMPLICITFAST,
    INTEGRATORS,
    Integrator,
    find_refusal,
)
from grader.numerics.scene import Scene
from grader.numerics.stability.linear import linearise_step
from grader.numerics.version import INSTALLED, parse_version
from numerics.measuring import errors
from numerics.models import ALL, LESSON, hinge

TIMES = list_sample_times(1.0, 0.02)
TIMESTEPS_S = {1: [0.001, 0.0005, 0.00025, 0.0001], 4: [0.0008, 0.0004, 0.0002, 0.00016]}
"""By order, in the range where the error is neither saturated nor rounding."""


@contextmanager
def counted_evaluations() -> Iterator[list[None]]:
    """Gains an entry with each computation of passive forces: one per evaluation of the forward dynamics."""
    calls: list[None] = []
    mujoco.set_mjcb_passive(lambda _model, _data: calls.append(None))
    try:
        yield calls
    finally:
        mujoco.set_mjcb_passive(None)


def ids(integrator: Integrator) -> str:
    return integrator.name


def test_the_codes_are_those_of_mujoco() -> None:
    assert sorted(BY_CODE) == sorted(int(code) for code in mujoco.mjtIntegrator.__members__.values())
    assert [f"mjINT_{integrator.name.upper()}" for integrator in INTEGRATORS] == [
        mujoco.mjtIntegrator(integrator.code).name for integrator in INTEGRATORS
    ]


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=ids)
def test_mjcf_accepts_the_name(integrator: Integrator) -> None:
    xml = f'<mujoco><option integrator="{integrator.name}"/></mujoco>'
    assert int(mujoco.MjModel.from_xml_string(xml).opt.integrator) == integrator.code


def test_quiz_files_accept_the_same_names() -> None:
    assert set(get_args(IntegratorName)) == set(BY_NAME)


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=ids)
@pytest.mark.parametrize("name", LESSON)
def test_a_step_costs_as_many_evaluations(name: str, integrator: Integrator) -> None:
    with Scene.from_xml(LESSON[name]).borrow(integrator=integrator.code) as workspace, counted_evaluations() as calls:
        mujoco.mj_step(workspace.model, workspace.data, nstep=10)
    assert len(calls) == 10 * integrator.evaluations


def order_of(scene: Scene, integrator: Integrator, timesteps_s: list[float]) -> float:
    differences = errors(scene, solve_dop853(scene, TIMES), timesteps_s, integrator=integrator.code)
    return fit_order(timesteps_s, [error.qpos for error in differences]).order


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=ids)
def test_errors_shrink_with_the_order(integrator: Integrator) -> None:
    scene = Scene.from_xml(LESSON["double_pendulum"], key="release")
    assert order_of(scene, integrator, TIMESTEPS_S[integrator.order]) == pytest.approx(integrator.order, abs=0.1)


def test_a_refused_integrator_is_told_by_mujoco() -> None:
    """Both versions refuse elasticity under the implicit integrators, 4.0.0 alone edge damping under `discrete`."""
    cloth = ALL["flex"].replace('<edge equality="true" damping="0.01"/>', "{}")
    elastic = mujoco.MjModel.from_xml_string(
        cloth.format('<elasticity young="1e4" thickness="0.01" elastic2d="both"/>')
    )
    assert [integrator for integrator in INTEGRATORS if find_refusal(elastic, integrator) is not None] == [
        IMPLICIT,
        IMPLICITFAST,
    ]
    assert "flex elasticity" in (find_refusal(elastic, IMPLICIT) or "")
    damped = mujoco.MjModel.from_xml_string(ALL["flex"])
    refused = [integrator for integrator in INTEGRATORS if find_refusal(damped, integrator) is not None]
    assert refused == ([DISCRETE] if parse_version(INSTALLED) >= (4, 0, 0) else [])


def velocity_gain(xml: str, integrator: Integrator) -> float:
    """d(next velocity)/d(velocity) of a hinge over one step of H."""
    return float(linearise_step(Scene.from_xml(xml), timestep_s=H, integrator=integrator.code)[1, 1])


WEIGHTLESS = "<option gravity='0 0 0'/>"
DAMPED = hinge("damping='0.5'", rest=WEIGHTLESS)
SERVO = hinge(rest=f"{WEIGHTLESS}<actuator><position joint='hinge' kp='40' kv='0.5'/></actuator>")
INERTIA = 0.251
H = 0.1


@pytest.mark.parametrize("integrator", [EULER, IMPLICIT, IMPLICITFAST, DISCRETE], ids=ids)
def test_joint_damping_is_implicit(integrator: Integrator) -> None:
    """v' = v / (1 + h c / I), where the explicit step gives v (1 - h c / I)."""
    assert velocity_gain(DAMPED, integrator) == pytest.approx(1 / (1 + H * 0.5 / INERTIA), abs=1e-6)


def test_joint_damping_is_explicit_for_euler_without_eulerdamp() -> None:
    explicit = DAMPED.replace(WEIGHTLESS, "<option gravity='0 0 0'><flag eulerdamp='disable'/></option>")
    assert velocity_gain(explicit, EULER) == pytest.approx(1 - H * 0.5 / INERTIA, abs=1e-6)


def test_actuators_are_implicit_as_the_notes_say() -> None:
    explicit = 1 - H * 0.5 / INERTIA
    assert velocity_gain(SERVO, EULER) == pytest.approx(explicit, abs=1e-6)
    for integrator in (IMPLICIT, IMPLICITFAST):
        assert velocity_gain(SERVO, integrator) == pytest.approx(1 / (1 + H * 0.5 / INERTIA), abs=1e-6)
    both = INERTIA + H * 0.5 + H**2 * 40
    assert velocity_gain(SERVO, DISCRETE) == pytest.approx(INERTIA / both, abs=1e-6)
    pgs = SERVO.replace(WEIGHTLESS, "<option gravity='0 0 0' solver='PGS'/>")
    assert velocity_gain(pgs, DISCRETE) == pytest.approx(explicit, abs=1e-6)


def test_only_implicit_differentiates_coriolis_forces() -> None:
    """On a conservative double pendulum Euler, implicitfast and discrete take the same step."""
    scene = Scene.from_xml(LESSON["double_pendulum"]).at(qpos=[2.0, 0.5], qvel=[1.0, -2.0])
    ends = {}
    for integrator in INTEGRATORS:
        with scene.borrow(timestep_s=0.002, integrator=integrator.code) as workspace:
            mujoco.mj_step(workspace.model, workspace.data)
            ends[integrator] = workspace.data.qvel.tobytes()
    assert ends[EULER] == ends[IMPLICITFAST] == ends[DISCRETE] != ends[IMPLICIT]
