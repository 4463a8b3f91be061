"""A generator that has stepped while the script was imported, and goes on."""

import mujoco


def stepping():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>")
    data = mujoco.MjData(model)
    while True:
        mujoco.mj_step(model, data)
        model, data = yield


generator = stepping()
next(generator)


def step(model, data):
    generator.send((model, data))
