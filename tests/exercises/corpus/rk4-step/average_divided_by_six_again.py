# mistake: np.average has divided by the sum of the weights already; the step divides by six once more.
# next: Multiply the average by h, not by h/6.
# status: incorrect
# told: The weights 1, 2, 2, 1 are divided by 36, not by 6: they do not sum to
import mujoco
import numpy as np


def rk4_step(model, data):
    h = model.opt.timestep
    start = [data.qpos.copy(), data.qvel.copy(), data.act.copy()]
    t = data.time

    def rates(move, slope):
        for target, s, d in zip((data.qpos, data.qvel, data.act), start, slope):
            target[:] = s + move * d
        data.time = t + move
        mujoco.mj_forward(model, data)
        return [data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()]

    zero = [np.zeros_like(s) for s in start]
    k = [rates(0, zero)]
    k.append(rates(h / 2, k[-1]))
    k.append(rates(h / 2, k[-1]))
    k.append(rates(h, k[-1]))
    for i, target in enumerate((data.qpos, data.qvel, data.act)):
        mean = np.average([kk[i] for kk in k], axis=0, weights=[1, 2, 2, 1])
        target[:] = start[i] + h / 6 * mean
    data.time = t + h
