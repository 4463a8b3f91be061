"""Pulls a body of a running lab by a point of one of its geoms, as a viewer's mouse does."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import mujoco
import numpy as np

from grader.errors import LabRefused

PULLS_MAX = 8
PULL_S_MAX = 5.0
"""The longest pull [s]."""

REACH_MAX = 1e3
"""The largest coordinate of a point [m]."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Pull:
    """A spring from a point of the drawn geom number `geom`, in the geom's own frame [m], to a goal in the world [m],
    from `begin` until `end` [s]."""

    geom: int
    point: Vector
    goal: Vector
    begin: float
    end: float


def check_pulls(pulls: Sequence[Pull]) -> None:
    """Raises LabRefused for pulls that no run may have."""
    if len(pulls) > PULLS_MAX:
        raise LabRefused(f"At most {PULLS_MAX} pulls fit into one run.")
    for pull in pulls:
        if not all(isfinite(value) and abs(value) <= REACH_MAX for value in (*pull.point, *pull.goal)):
            raise LabRefused(f"The point and the goal of a pull lie within {REACH_MAX:g} m.")
        if not (isfinite(pull.begin) and 0 <= pull.begin < pull.end <= pull.begin + PULL_S_MAX):
            raise LabRefused(f"A pull begins at 0 s or later, and lasts more than 0 and at most {PULL_S_MAX:g} s.")


class Puller:
    """Applies the force of a pull to its body in a model and data, as MuJoCo's viewer does (mjv_applyPerturbForce): a
    spring of `visual/map/stiffness`, damped to a half of critical, times the mass with which the point resists."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int], pull: Pull) -> None:
        """Raises LabRefused for a geom that is not drawn or that cannot move."""
        if not pull.geom < len(geoms):
            raise LabRefused(f"There is no geom {pull.geom}: the scene draws {len(geoms)}.")
        geom = geoms[pull.geom]
        self.model, self.data, self.pull, self.body = model, data, pull, int(model.geom_bodyid[geom])
        if is_fixed(model, self.body):
            raise LabRefused(f"Geom {pull.geom} is fixed to the world: nothing pulls it.")
        self.spring = mujoco.MjvPerturb()
        self.spring.select, self.spring.active = self.body, int(mujoco.mjtPertBit.mjPERT_TRANSLATE)
        turned = np.empty(3)
        mujoco.mju_rotVecQuat(turned, np.array(pull.point), model.geom_quat[geom])
        self.spring.localpos[:] = model.geom_pos[geom] + turned
        self.spring.refselpos[:] = pull.goal
        self.before = self.during = np.zeros(6)

    def apply(self) -> None:
        """Adds the force of this moment, which is constant during a step, to what else is applied to the body."""
        applied = self.data.xfrc_applied[self.body]
        self.before = applied.copy()
        self.spring.localmass = self.measure_mass()
        mujoco.mjv_applyPerturbForce(self.model, self.data, self.spring)  # in place of what was applied
        applied += self.before
        self.during = applied.copy()

    def measure_mass(self) -> float:
        """Returns the mass with which the point resists [kg]. Source: 3 / trace(J inv(M) J'), as in mjv_initPerturb."""
        model, data = self.model, self.data
        rotation = data.xmat[self.body].reshape(3, 3)
        point = data.xpos[self.body] + rotation @ self.spring.localpos
        jacobian, solved = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, point, self.body)
        mujoco.mj_solveM(model, data, solved, jacobian)
        return float(3 / max(mujoco.mjMINVAL, np.sum(jacobian * solved)))

    def release(self) -> None:
        """Takes the force away after a step. Of several the last one that was applied is released first. A state that
        MuJoCo has reset has no applied forces, and stays so."""
        applied = self.data.xfrc_applied[self.body]
        if np.array_equal(applied, self.during):
            applied[:] = self.before


def is_fixed(model: mujoco.MjModel, body: int) -> bool:
    """Whether no joint moves a body."""
    return int(model.body_weldid[body]) == 0
