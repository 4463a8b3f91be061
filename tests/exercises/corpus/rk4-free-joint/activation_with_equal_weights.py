# mistake: The activation is advanced with the plain mean of its four slopes, not with the weights 1, 2, 2, 1 over 6.
# next: Give act_dot the same weights as the rest.
# status: partial
# told: the weights of the four act_dot are 1, 2, 2, 1 over 6
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco
import numpy as np


def rk4_step(model, data):
    dt = model.opt.timestep
    qpos, qvel, act, time = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    velocities, accelerations, rates = [], [], []
    for stage, c in enumerate((0.0, 0.5, 0.5, 1.0)):
        if stage > 0:
            data.qpos[:] = qpos
            mujoco.mj_integratePos(model, data.qpos, velocities[-1], c * dt)
            data.qvel[:] = qvel + c * dt * accelerations[-1]
            data.act[:] = act + c * dt * rates[-1]
            data.time = time + c * dt
        mujoco.mj_forward(model, data)
        velocities.append(data.qvel.copy())
        accelerations.append(data.qacc.copy())
        rates.append(data.act_dot.copy())
    average = lambda k: np.average(k, axis=0, weights=[1, 2, 2, 1])
    data.qpos[:] = qpos
    mujoco.mj_integratePos(model, data.qpos, average(velocities), dt)
    data.qvel[:] = qvel + dt * average(accelerations)
    data.act[:] = act + dt * np.mean(rates, axis=0)
    data.time = time + dt
