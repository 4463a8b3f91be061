"""Any explicit tableau; a self-test against MuJoCo's RK4 runs when the script is imported, and prints."""
import mujoco
import numpy as np
from mjcourse import model_path

A = np.array([[0, 0, 0, 0], [0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 1, 0]])
B = np.array([1, 2, 2, 1]) / 6
C = A.sum(axis=1)


def get(data):
    return np.concatenate([data.qpos, data.qvel, data.act])


def put(model, data, y, t):
    data.qpos[:], data.qvel[:], data.act[:] = np.split(y, [model.nq, model.nq + model.nv])
    data.time = t


def rk4_step(model, data):
    h, t, y = model.opt.timestep, data.time, get(data)
    k = np.zeros((4, y.size))
    for i in range(4):
        put(model, data, y + h * A[i] @ k, t + C[i] * h)
        mujoco.mj_forward(m=model, d=data)
        k[i] = np.concatenate([data.qvel, data.qacc, data.act_dot])
    put(model, data, y + h * B @ k, t + h)


def self_test():
    model = mujoco.MjModel.from_xml_path(str(model_path("double_pendulum")))
    mine, theirs = mujoco.MjData(model), mujoco.MjData(model)
    for data in (mine, theirs):
        mujoco.mj_resetDataKeyframe(model, data, 0)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for _ in range(500):
        rk4_step(model, mine)
        mujoco.mj_step(model, theirs)
    worst = np.abs(mine.qpos - theirs.qpos).max()
    print("self-test", worst)
    assert worst < 1e-10


self_test()
