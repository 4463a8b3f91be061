# mistake: The accelerations of the stages are kept without copying, so all four are the last one when they are summed.
# next: Append data.qacc.copy() (and data.qvel.copy()) at every stage.
# status: incorrect
# told: All accelerations equal the last one: data.qacc is a view that the next mj_forward
import mujoco

C = [0.0, 0.5, 0.5, 1.0]
B = [1 / 6, 1 / 3, 1 / 3, 1 / 6]


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, act0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    V, A, W = [], [], []
    for i, c in enumerate(C):
        if i > 0:
            data.qpos[:] = q0 + c * h * V[i - 1]
            data.qvel[:] = v0 + c * h * A[i - 1]
            data.act[:] = act0 + c * h * W[i - 1]
        data.time = t0 + c * h
        mujoco.mj_forward(model, data)
        V.append(data.qvel.copy())
        A.append(data.qacc)
        W.append(data.act_dot)
    data.qpos[:] = q0 + h * sum(b * x for b, x in zip(B, V))
    data.qvel[:] = v0 + h * sum(b * x for b, x in zip(B, A))
    data.act[:] = act0 + h * sum(b * x for b, x in zip(B, W))
    data.time = t0 + h
