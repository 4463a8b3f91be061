# diagnosis: return MJCF text, or a mujoco.MjSpec
"""A compiled model is no text."""

import mujoco


def make_cart(mass, height, gear):
    return mujoco.MjModel.from_xml_string("<mujoco/>")
