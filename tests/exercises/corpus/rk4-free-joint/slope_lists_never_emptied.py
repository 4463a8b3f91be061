# mistake: The lists of slopes are globals to which every call appends, so every step sums the four slopes of the first step.
# next: Make the lists new in every call.
# status: incorrect
# told: The slopes in your stages are those of an earlier call: a list outside of the
import mujoco

K_Q, K_V, K_A = [], [], []


def evaluate(model, data):
    mujoco.mj_forward(model, data)
    K_Q.append(data.qvel.copy())
    K_V.append(data.qacc.copy())
    K_A.append(data.act_dot.copy())


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, a, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    if K_Q and K_Q[0].size != model.nv:
        K_Q.clear(), K_V.clear(), K_A.clear()
    evaluate(model, data)
    for i, part in enumerate((h / 2, h / 2, h)):
        data.qpos[:] = q
        mujoco.mj_integratePos(model, data.qpos, K_Q[i], part)
        data.qvel[:] = v + part * K_V[i]
        data.act[:] = a + part * K_A[i]
        data.time = t + part
        evaluate(model, data)
    data.qpos[:] = q
    mujoco.mj_integratePos(model, data.qpos, (K_Q[0] + 2 * K_Q[1] + 2 * K_Q[2] + K_Q[3]) / 6, h)
    data.qvel[:] = v + h / 6 * (K_V[0] + 2 * K_V[1] + 2 * K_V[2] + K_V[3])
    data.act[:] = a + h / 6 * (K_A[0] + 2 * K_A[1] + 2 * K_A[2] + K_A[3])
    data.time = t + h
