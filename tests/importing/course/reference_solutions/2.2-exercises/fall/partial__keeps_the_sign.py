# diagnosis: Speed has the wrong sign.
import mujoco


def measure(model, data):
    while data.qpos[0] > 0:
        time, angle = data.time, data.qpos[0]
        mujoco.mj_step(model, data)
    return {"passes": time + model.opt.timestep * angle / (angle - data.qpos[0]), "speed": data.qvel[0]}
