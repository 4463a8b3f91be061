# mistake: Each stage is added to the state of the stage before instead of to the start of the step.
# next: Set the state back to its copy of the start before each stage.
# status: incorrect
# told: Each of your stages starts from the state of the stage before; restore q and v to the
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q_start = data.qpos.copy()
    v_start = data.qvel.copy()
    act_start = data.act.copy()
    t = data.time
    sum_q, sum_v, sum_a = 0, 0, 0
    for weight, advance in [(1, h / 2), (2, h / 2), (2, h), (1, 0)]:
        mujoco.mj_forward(model, data)
        kq, kv, ka = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
        sum_q = sum_q + weight * kq
        sum_v = sum_v + weight * kv
        sum_a = sum_a + weight * ka
        # move on to the next stage
        data.qpos += advance * kq
        data.qvel += advance * kv
        data.act += advance * ka
        data.time = t + advance
    data.qpos[:] = q_start + h / 6 * sum_q
    data.qvel[:] = v_start + h / 6 * sum_v
    data.act[:] = act_start + h / 6 * sum_a
    data.time = t + h
