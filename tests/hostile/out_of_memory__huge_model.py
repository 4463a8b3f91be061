"""MuJoCo allocates in C."""
# limits: memory_mb=256

import mujoco

model = mujoco.MjModel.from_xml_string('<mujoco><size memory="100G"/><worldbody/></mujoco>')
mujoco.MjData(model)
