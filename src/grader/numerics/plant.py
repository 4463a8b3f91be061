"""A model that is driven from outside, one control period at a time. It stops at MuJoCo's first warning: with automatic
resets on, a control that is too large would move it back to its start, where it stands well again."""

from math import isfinite

import mujoco
import numpy as np
from mujoco import mjtObj
from numpy.typing import NDArray

from grader.numerics.scene import Scene

NO_RESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
Vector = NDArray[np.float64]

STATE_PARTS = ("qpos", "qvel", "act")


class Plant:
    """One run of a scene from its start. `data` is fresh after every period: sensors and accelerations belong to the
    state. Whatever is written into it before `advance` acts over the next period."""

    def __init__(self, scene: Scene) -> None:
        self._workspace = scene.lend()  # never returned: the run may leave anything in it
        self.scene, self.model, self.data = scene, self._workspace.model, self._workspace.data
        self.model.opt.disableflags |= NO_RESET
        limited = self.model.actuator_ctrllimited.astype(bool)[:, None]
        self._low, self._high = np.where(limited, self.model.actuator_ctrlrange, [-np.inf, np.inf]).T
        self._qacc = self.data.qacc
        self._pushed = self.data.actuator_force, self.data.actuator_velocity
        mujoco.mj_forward(self.model, self.data)
        self.stopped = self._is_lost()

    def advance(self, steps: int) -> bool:
        """Takes steps with the controls in `data`; returns whether the run goes on. After a warning it is `stopped`."""
        try:
            mujoco.mj_step(self.model, self.data, steps)
            if not self._is_lost():
                mujoco.mj_forward(self.model, self.data)
        except mujoco.FatalError:
            self.stopped = True
        self.stopped = self.stopped or self._is_lost()
        return not self.stopped

    def _is_lost(self) -> bool:
        # The square is finite where all are: MuJoCo has warned of any beyond 1e10.
        return any(self._workspace.warned) or not isfinite(self._qacc.dot(self._qacc))

    def find_sensor(self, name: str) -> slice:
        """Returns the part of sensordata of a sensor. Raises KeyError where there is none of that name."""
        index = mujoco.mj_name2id(self.model, mjtObj.mjOBJ_SENSOR, name)
        if index < 0:
            known = ", ".join(filter(None, (self.model.sensor(i).name for i in range(self.model.nsensor)))) or "none"
            raise KeyError(f"the model has no sensor {name!r}; it has: {known}")
        begin = int(self.model.sensor_adr[index])
        return slice(begin, begin + int(self.model.sensor_dim[index]))

    def find_reading(self, name: str) -> Vector:
        """Returns a view of what a name stands for: a sensor, or the state's part `qpos`, `qvel` or `act`, where no
        sensor has that name. Raises KeyError."""
        if name in STATE_PARTS and mujoco.mj_name2id(self.model, mjtObj.mjOBJ_SENSOR, name) < 0:
            part: Vector = getattr(self.data, name)
            return part
        return np.asarray(self.data.sensordata[self.find_sensor(name)])

    def find_dof(self, joint: str) -> int:
        """Returns the place in qvel of a joint of one degree of freedom. Raises KeyError and ValueError."""
        index = self.scene.find_id(mjtObj.mjOBJ_JOINT, joint)
        if self.model.jnt_type[index] not in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
            raise ValueError(f"joint {joint!r} has more than one coordinate")
        return int(self.model.jnt_dofadr[index])

    def clip(self, controls: Vector) -> Vector:
        """Returns controls (nu,) within the actuators' ranges."""
        clipped: Vector = np.minimum(np.maximum(controls, self._low), self._high)
        return clipped

    @property
    def power_w(self) -> float:
        """The mechanical power of all actuators, without regard to its direction [W]."""
        force, velocity = self._pushed
        return float(np.abs(force * velocity).sum())
