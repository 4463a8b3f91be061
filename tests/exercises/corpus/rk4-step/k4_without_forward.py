# mistake: mj_forward is not called for the fourth stage, so k4 uses the acceleration of the third.
# next: Call mj_forward after setting the state of every stage.
# status: incorrect
# told: In your stage 4 mj_forward is not called: data.qacc is still that of stage 3
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t0 = data.time
    q0 = data.qpos.copy()
    qd0 = data.qvel.copy()
    a0 = data.act.copy()

    # --- k1
    mujoco.mj_forward(model, data)
    dq1 = data.qvel.copy()
    dv1 = data.qacc.copy()
    da1 = data.act_dot.copy()

    # --- k2
    data.qpos[:] = q0 + dq1 * h / 2
    data.qvel[:] = qd0 + dv1 * h / 2
    data.act[:] = a0 + da1 * h / 2
    data.time = t0 + h / 2
    mujoco.mj_forward(model, data)
    dq2 = data.qvel.copy()
    dv2 = data.qacc.copy()
    da2 = data.act_dot.copy()

    # --- k3
    data.qpos[:] = q0 + dq2 * h / 2
    data.qvel[:] = qd0 + dv2 * h / 2
    data.act[:] = a0 + da2 * h / 2
    mujoco.mj_forward(model, data)
    dq3 = data.qvel.copy()
    dv3 = data.qacc.copy()
    da3 = data.act_dot.copy()

    # --- k4
    data.qpos[:] = q0 + dq3 * h
    data.qvel[:] = qd0 + dv3 * h
    data.act[:] = a0 + da3 * h
    data.time = t0 + h
    dq4 = data.qvel.copy()
    dv4 = data.qacc.copy()
    da4 = data.act_dot.copy()

    data.qpos[:] = q0 + h * (dq1 + 2 * dq2 + 2 * dq3 + dq4) / 6
    data.qvel[:] = qd0 + h * (dv1 + 2 * dv2 + 2 * dv3 + dv4) / 6
    data.act[:] = a0 + h * (da1 + 2 * da2 + 2 * da3 + da4) / 6
