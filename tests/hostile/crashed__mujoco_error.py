"""MuJoCo's own fatal error."""

import mujoco

mujoco.MjModel.from_xml_string('<mujoco><worldbody><body><joint type="free"/></body></worldbody></mujoco>')
