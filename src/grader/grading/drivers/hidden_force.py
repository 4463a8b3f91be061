"""A smooth force that exists nowhere but in one mj_forward: f(q, v, t) = a sin(P q + V v + w t + p) in every dof.

Whoever takes accelerations from that mj_forward feels it; every other route through MuJoCo's stepping does not. The
same text runs in the jail (around the student's mj_forward) and in our own process (around the judge's).
"""

from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np

Forward = Callable[[mujoco.MjModel, mujoco.MjData], object]


def with_force(forward: Forward, spec: Mapping[str, Any] | None) -> Forward:
    """`forward` with the force of `spec` added for models of its size; qfrc_applied is as before afterwards.

    What is looked up on a class or module is looked up here, before any student's code could have replaced it.
    """
    if spec is None:
        return forward
    sin, model_type, data_type = np.sin, mujoco.MjModel, mujoco.MjData
    nq, nv = (getattr(model_type, name).fget for name in ("nq", "nv"))
    qpos, qvel, time, qfrc_applied = (
        getattr(data_type, name).fget for name in ("qpos", "qvel", "time", "qfrc_applied")
    )
    amplitude, position, velocity, phase = (
        np.array(spec[name], dtype=np.float64) for name in ("amplitude", "position", "velocity", "phase")
    )
    rate, size = float(spec["rate"]), (position.shape[1], velocity.shape[1])

    def forced(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if type(model) is not model_type or type(data) is not data_type or (nq(model), nv(model)) != size:
            forward(model, data)
            return
        applied = qfrc_applied(data)
        saved = applied.copy()
        force = position.dot(qpos(data))  # in place from here on: this runs ten thousand times in a grading
        force += velocity.dot(qvel(data))
        force += phase
        if rate:
            force += rate * time(data)
        sin(force, force)
        force *= amplitude
        applied += force
        try:
            forward(model, data)
        finally:
            applied[:] = saved

    return forced
