# diagnosis: The function returns an MjModel: return MJCF text, or a mujoco.MjSpec, not the compiled model
"""A compiled model is no text."""

import mujoco


def make_cart(mass, height, gear):
    return mujoco.MjModel.from_xml_string("<mujoco/>")
