"""An <include> that leaves the jail."""

import mujoco

mujoco.MjModel.from_xml_string('<mujoco><include file="/etc/passwd"/></mujoco>')
