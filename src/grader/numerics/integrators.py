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


EULER = Integrator(
    int(mjtIntegrator.mjINT_EULER), "Euler", 1, 1, "semi-implicit; implicit in joint damping unless eulerdamp is off"
)
RK4 = Integrator(
    int(mjtIntegrator.mjINT_RK4), "RK4", 4, 4, f"explicit; of order {RK4_ORDER_ON_ROTATIONS} on free and ball joints"
)
IMPLICIT = Integrator(
    int(mjtIntegrator.mjINT_IMPLICIT),
    "implicit",
    1,
    1,
    "implicit in velocity, Coriolis and centripetal forces included",
)
IMPLICITFAST = Integrator(
    int(mjtIntegrator.mjINT_IMPLICITFAST),
    "implicitfast",
    1,
    1,
    "implicit in velocity except Coriolis and centripetal forces",
)
DISCRETE = Integrator(
    int(mjtIntegrator.mjINT_DISCRETE), "discrete", 1, 1, "implicit in damping and stiffness; explicit under solver PGS"
)

INTEGRATORS = (EULER, RK4, IMPLICIT, IMPLICITFAST, DISCRETE)
"""All of them, in the order of the lesson's tables."""

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
