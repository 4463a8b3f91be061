"""Write drone_policy.npz, a network of one hidden layer of 12 units. What is here runs, but only hovers.

Try it on your own machine first:  python drone_policy.py
"""

import math

import mujoco
import numpy as np
from mjcourse import model_path

W1, b1 = np.zeros((6, 12)), np.zeros(12)
W2, b2 = np.zeros((12, 2)), np.full(2, (9.81 / 2 - 5) / 5)

if __name__ == "__main__":
    np.savez("drone_policy.npz", W1=W1, b1=b1, W2=W2, b2=b2)
    model = mujoco.MjModel.from_xml_path(str(model_path("planar_drone")))
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    earned = 0.0
    while data.time < 4:
        mujoco.mj_forward(model, data)
        outputs = np.maximum(data.sensordata @ W1 + b1, 0) @ W2 + b2
        data.ctrl[:] = np.clip(5 + 5 * outputs, 0, 10)
        mujoco.mj_step(model, data, 4)
        x, z, tilt = data.qpos
        earned += math.exp(-(x**2 + z**2) / 0.1) - 0.1 * abs(tilt)
    print(f"after 4 s: {x:.3f} m to the side, {z:.3f} m up; earned {earned:.1f}, 110 are needed")
