# mistake: The stages run in a second MjData that gets positions, velocities and activations but not ctrl, so actuators see zero.
# next: Copy data.ctrl into the second MjData, or evaluate the stages in data itself.
# status: partial
# told: data.ctrl differs in your calls of mj_forward from before the step: data.ctrl must
import mujoco

_scratch = {}


def rk4_step(model, data):
    # never touch the user's data during the stages
    if id(model) not in _scratch:
        _scratch.clear()
        _scratch[id(model)] = (model, mujoco.MjData(model))
    tmp = _scratch[id(model)][1]
    h = model.opt.timestep

    def k(dt, prev):
        tmp.qpos[:] = data.qpos
        tmp.qvel[:] = data.qvel
        tmp.act[:] = data.act
        if prev is not None:
            tmp.qpos += dt * prev[0]
            tmp.qvel += dt * prev[1]
            tmp.act += dt * prev[2]
        tmp.time = data.time + dt
        mujoco.mj_forward(model, tmp)
        return tmp.qvel.copy(), tmp.qacc.copy(), tmp.act_dot.copy()

    k1 = k(0, None)
    k2 = k(h / 2, k1)
    k3 = k(h / 2, k2)
    k4 = k(h, k3)
    data.qpos += h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel += h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act += h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time += h
