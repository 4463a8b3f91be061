"""Write servo_arm_policy.npz, a network of two hidden layers of 32 units. What is here runs, but is not trained.

Try it on your own machine first:  python servo_arm_policy.py
"""

import mujoco
import numpy as np
from mjcourse import model_path

rng = np.random.default_rng(0)
arrays = {
    "W1": rng.normal(0, 0.5, (3, 32)), "b1": np.zeros(32),
    "W2": rng.normal(0, 0.2, (32, 32)), "b2": np.zeros(32),
    "W3": rng.normal(0, 0.2, (32, 1)), "b3": np.zeros(1),
    "mean": np.zeros(3), "std": np.array([1, 2.5, 0.9]),
}  # fmt: skip


def act(observation):
    """Return the torque in N m for angle, rate and target, as the grader computes it."""
    x = (observation - arrays["mean"]) / arrays["std"]
    x = np.tanh(x @ arrays["W1"] + arrays["b1"])
    x = np.tanh(x @ arrays["W2"] + arrays["b2"])
    return 12 * np.tanh(x @ arrays["W3"] + arrays["b3"])


if __name__ == "__main__":
    # Train here: for instance imitate a law that you know on drawn states.
    np.savez("servo_arm_policy.npz", **arrays)
    model = mujoco.MjModel.from_xml_path(str(model_path("servo_arm")))
    data = mujoco.MjData(model)
    while data.time < 3:
        mujoco.mj_forward(model, data)
        data.ctrl[:] = act(np.append(data.sensordata, 1.2))
        mujoco.mj_step(model, data, 10)
    print(f"after 3 s: {data.qpos[0]:.3f} rad; the target is 1.2 rad")
