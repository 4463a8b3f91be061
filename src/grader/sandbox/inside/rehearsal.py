"""Does what most scripts do, in each child before its job arrives: the pages of memory that a job writes are then the
child's own. To copy one at its first write takes as long as some steps of a small model, and a job writes hundreds.
Nothing here depends on a job, and nothing is kept."""

import pickle
from types import ModuleType
from typing import Any

XML = """
<mujoco>
  <worldbody>
    <body>
      <joint name="hinge" axis="0 1 0"/>
      <inertial pos="0 0 -0.5" mass="1" diaginertia="1e-4 1e-4 1e-4"/>
    </body>
  </worldbody>
  <actuator><position joint="hinge" kp="10" kv="1"/></actuator>
</mujoco>
"""
SOURCE = """
import mujoco
import numpy as np


def simulate(model, steps):
    model.opt.timestep, model.opt.integrator = 0.001, mujoco.mjtIntegrator.mjINT_EULER
    data = mujoco.MjData(model)
    mujoco.mj_resetData(model, data)
    data.qpos[0] = 1.0
    while data.time < steps * model.opt.timestep:
        data.ctrl[:] = -0.1 * data.qvel
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    k = np.concatenate([data.qpos.copy(), data.qvel.copy(), data.qacc.copy()])
    if not np.isfinite(k).all() or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or data.warning.number.any():
        return None
    return k / 6 * 2
"""


class Rehearsal:
    """A small script, and a compiled model."""

    def __init__(self) -> None:
        import mujoco

        model = mujoco.MjSpec.from_string(XML).compile()  # which leaves no text behind, as MjModel does
        self.model = pickle.dumps(model)

    def run(self) -> None:
        """Runs the script on the model."""
        module: Any = ModuleType("rehearsal")
        exec(compile(SOURCE, "rehearsal.py", "exec", dont_inherit=True), vars(module))  # noqa: S102 - our own
        module.simulate(pickle.loads(self.model), 3)  # noqa: S301 - our own
