# mistake: Joint damping is subtracted again, though qacc holds it already.
# next: Leave the damping to mj_forward.
# status: partial
# told: Your accelerations take off damping once more: data.qacc holds it already, so integrate it as
import mujoco

NODES = (0.0, 0.5, 0.5, 1.0)
WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, act0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    dq, dv, da = 0 * v0, 0 * v0, 0 * act0
    sq, sv, sa = 0 * v0, 0 * v0, 0 * act0
    for c, b in zip(NODES, WEIGHTS):
        data.qpos[:] = q0 + c * h * dq
        data.qvel[:] = v0 + c * h * dv
        data.act[:] = act0 + c * h * da
        data.time = t0 + c * h
        mujoco.mj_forward(model, data)
        dq, dv, da = data.qvel.copy(), data.qacc - model.dof_damping * data.qvel, data.act_dot.copy()
        sq += b * dq
        sv += b * dv
        sa += b * da
    data.qpos[:] = q0 + h * sq
    data.qvel[:] = v0 + h * sv
    data.act[:] = act0 + h * sa
    data.time = t0 + h
