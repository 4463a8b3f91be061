# diagnosis: is measured in a run that begins where another one has ended
import mujoco
import numpy as np
def shake(model, data):
    mujoco.mj_resetData(model, data)
    z = []
    while data.time < 9:
        data.ctrl[0] = 8*np.sin(6*data.time)
        mujoco.mj_step(model, data)
        if data.time > 6: z.append(data.joint("table").qpos[0])
    amp = (max(z)-min(z))/2
    data.ctrl[:] = 12
    t, z = [], []
    while data.time < 21:
        mujoco.mj_step(model, data)
        t.append(data.time); z.append(data.joint("table").qpos[0])
    t, z = np.array(t), np.array(z)
    end = z[-1]
    settled = t[np.nonzero(abs(z-end) > 0.002)[0][-1]]
    return {"amplitude": amp, "settled": settled, "rest": (end-5e-5, end+5e-5)}
