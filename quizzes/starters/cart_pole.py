"""Balance a pole on a cart. What is here runs, but lets the pole fall.

Try it on your own machine first:  python cart_pole.py
"""

import mujoco
from mjcourse import model_path


def make(model):
    """Return act(t, observation); called anew for each episode."""

    def act(t, observation):
        cart, pole, cart_rate, pole_rate = observation
        # Push the cart under the pole, and bring it home.
        return 0.0

    return act


if __name__ == "__main__":
    cart_pole = mujoco.MjModel.from_xml_path(str(model_path("cart_pole")))
    state = mujoco.MjData(cart_pole)
    state.qpos[1] = 0.1
    act = make(cart_pole)
    while state.time < 5:
        mujoco.mj_forward(cart_pole, state)
        state.ctrl[:] = act(state.time, state.sensordata.copy())
        mujoco.mj_step(cart_pole, state, 5)
    print(f"after 5 s: cart {state.qpos[0]:.3f} m, pole {state.qpos[1]:.3f} rad")
