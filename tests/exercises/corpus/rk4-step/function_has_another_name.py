# mistake: The function is called runge_kutta_step, not rk4_step.
# next: Name it rk4_step.
# status: crashed
# told: Rename runge_kutta_step to rk4_step: the grader calls rk4_step.
import mujoco


def runge_kutta_step(model, data):
    h = model.opt.timestep
    q, v, t = data.qpos.copy(), data.qvel.copy(), data.time
    vs, accs = [], []
    for c in (0, 0.5, 0.5, 1):
        data.qpos[:] = q + c * h * (vs[-1] if vs else 0)
        data.qvel[:] = v + c * h * (accs[-1] if accs else 0)
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        vs.append(data.qvel.copy())
        accs.append(data.qacc.copy())
    data.qpos[:] = q + h / 6 * (vs[0] + 2 * vs[1] + 2 * vs[2] + vs[3])
    data.qvel[:] = v + h / 6 * (accs[0] + 2 * accs[1] + 2 * accs[2] + accs[3])
    data.time = t + h
