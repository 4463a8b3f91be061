"""MuJoCo's five integrators: the name of each, its order, and what a step costs. Source: mjtIntegrator of MuJoCo
3.14.0; its manual, "Numerical integration" in the chapter Computation; its change log for `discrete`. The tests measure
`order` and `evaluations`."""

import copy
from dataclasses import dataclass

import mujoco
from mujoco import mjtIntegrator

from grader.numerics.version import RK4_ORDER_ON_ROTATIONS


@dataclass(frozen=True)
class Integrator:
    """One integrator of MuJoCo. `code` is the value of mjtIntegrator, `name` the value of MJCF's `option/integrator`.
    `order` is the order of convergence of the positions on a smooth scene without quaternions, `evaluations` the number
    of evaluations of the forward dynamics per step."""

    code: int
    name: str
    order: int
    evaluations: int
    note: str


EULER, RK4, IMPLICIT, IMPLICITFAST, DISCRETE = INTEGRATORS = tuple(
    Integrator(int(getattr(mjtIntegrator, f"mjINT_{name.upper()}")), name, stages, stages, note)
    for name, stages, note in (
        ("Euler", 1, "semi-implicit; implicit in joint damping unless eulerdamp is off"),
        ("RK4", 4, f"explicit; of order {RK4_ORDER_ON_ROTATIONS} on free and ball joints"),
        ("implicit", 1, "implicit in velocity, Coriolis and centripetal forces included"),
        ("implicitfast", 1, "implicit in velocity except Coriolis and centripetal forces"),
        ("discrete", 1, "implicit in damping and stiffness; explicit under solver PGS"),
    )
)
"""All of them, in the order of the lesson's tables. The order of each is the number of evaluations in a step."""

BY_CODE = {integrator.code: integrator for integrator in INTEGRATORS}
BY_NAME = {integrator.name: integrator for integrator in INTEGRATORS}


def find_refusal(model: mujoco.MjModel, integrator: Integrator) -> str | None:
    """Why MuJoCo does not step this model with an integrator, in its own words; None if it does. What is refused
    depends on the version: 4.0.0 refuses edge damping of a flex under `discrete`, for example."""
    model = copy.copy(model)
    model.opt.integrator = integrator.code
    try:
        mujoco.mj_step(model, mujoco.MjData(model))
    except mujoco.FatalError as error:
        return str(error)
    return None
