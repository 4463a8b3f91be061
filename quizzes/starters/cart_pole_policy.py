"""Write cart_pole_policy.npz, four numbers that push a cart. What is here runs, but lets the pole fall.

Try it on your own machine first:  python cart_pole_policy.py
"""

import mujoco
import numpy as np
from mjcourse import model_path

# One row for each of: cart [m], pole [rad], cart_rate [m/s], pole_rate [rad/s].
W1 = np.zeros((4, 1))

if __name__ == "__main__":
    np.savez("cart_pole_policy.npz", W1=W1)
    model = mujoco.MjModel.from_xml_path(str(model_path("cart_pole")))
    data = mujoco.MjData(model)
    data.qpos[1] = 0.1
    while data.time < 5:
        mujoco.mj_forward(model, data)
        data.ctrl[:] = np.clip(data.sensordata @ W1, -20, 20)
        mujoco.mj_step(model, data, 5)
    print(f"after 5 s: cart {data.qpos[0]:.3f} m, pole {data.qpos[1]:.3f} rad")
