"""The word that the script has been imported, sent early; the inputs come, but after the integrators have gone."""

import json
import os
import struct
import mujoco

os.write(3, b"W")
size = struct.unpack("<I", os.read(4, 4))[0]
inputs = json.loads(os.read(4, size))
model = mujoco.MjModel.from_xml_string(inputs["xml"])
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
assert data.time == 0
os._exit(0)
