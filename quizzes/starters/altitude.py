"""Hold a height with noisy sensors. What is here runs, but never takes off.

Try it on your own machine first:  python altitude.py
"""

import mujoco
import numpy as np
from mjcourse import model_path


def make(model):
    """Return act(t, observation); called anew for each episode."""

    def act(t, observation):
        height, velocity, target = observation
        # Weight, spring, damper; then find out what the load weighs.
        return 0.0

    return act


if __name__ == "__main__":
    drone = mujoco.MjModel.from_xml_path(str(model_path("altitude")))
    state, noise = mujoco.MjData(drone), np.random.default_rng(0)
    act = make(drone)
    while state.time < 8:
        mujoco.mj_forward(drone, state)
        readings = state.sensordata + noise.normal(0, [0.01, 0.02])
        state.ctrl[:] = act(state.time, np.append(readings, 1.0))
        mujoco.mj_step(drone, state, 5)
    print(f"height after 8 s: {state.qpos[0]:.3f} m, the target is 1 m")
