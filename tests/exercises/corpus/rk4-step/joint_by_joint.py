# mistake: The joints are advanced one after the other, each with its own four stages while the others stand still.
# next: Move all joints together in every stage.
# status: incorrect
# told: Your step moves one joint at a time
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    for i in range(model.nv):
        x, v = data.qpos[i], data.qvel[i]
        mujoco.mj_forward(model, data)
        k1x, k1v = v, data.qacc[i]
        data.qpos[i], data.qvel[i] = x + k1x * h / 2, v + k1v * h / 2
        mujoco.mj_forward(model, data)
        k2x, k2v = data.qvel[i], data.qacc[i]
        data.qpos[i], data.qvel[i] = x + k2x * h / 2, v + k2v * h / 2
        mujoco.mj_forward(model, data)
        k3x, k3v = data.qvel[i], data.qacc[i]
        data.qpos[i], data.qvel[i] = x + k3x * h, v + k3v * h
        mujoco.mj_forward(model, data)
        k4x, k4v = data.qvel[i], data.qacc[i]
        data.qpos[i] = x + h / 6 * (k1x + 2 * k2x + 2 * k3x + k4x)
        data.qvel[i] = v + h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
    data.time = t + h
