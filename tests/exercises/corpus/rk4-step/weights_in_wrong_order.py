# mistake: The weights are 2, 1, 1, 2 instead of 1, 2, 2, 1.
# next: Give the two middle slopes the weight 2, and the slopes at both ends the weight 1.
# status: incorrect
# told: The first and the last slope have the weight 2, the others 1; the classical weights are
import mujoco

WEIGHTS = (2 / 6, 1 / 6, 1 / 6, 2 / 6)
NODES = (0, 1 / 2, 1 / 2, 1)


def rk4_step(model, data):
    h, t0 = model.opt.timestep, data.time
    start = {n: getattr(data, n).copy() for n in ("qpos", "qvel", "act")}
    slopes = []
    for node in NODES:
        for n, x in start.items():
            getattr(data, n)[:] = x + node * h * slopes[-1][n] if slopes else x
        data.time = t0 + node * h
        mujoco.mj_forward(model, data)
        slopes.append({"qpos": data.qvel.copy(), "qvel": data.qacc.copy(), "act": data.act_dot.copy()})
    for n, x in start.items():
        getattr(data, n)[:] = x + h * sum(w * s[n] for w, s in zip(WEIGHTS, slopes))
    data.time = t0 + h
