# mistake: The data is reset before every step, so each run is the same first step again and again.
# next: Reset once, before the loop over the steps.
# status: incorrect
# told: You reset the data before every step, so that each run is one step long and begins
from mujoco import MjData, mj_resetData, mj_step, mjtWarning


def ok(model, data, h):
    model.opt.timestep = h
    for _ in range(int(3 / h)):
        mj_resetData(model, data)
        data.qpos[0] = 1.0
        mj_step(model, data)
        for w in (mjtWarning.mjWARN_BADQPOS, mjtWarning.mjWARN_BADQVEL, mjtWarning.mjWARN_BADQACC):
            if data.warning[w].number:
                return False
    return True


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    data = MjData(model)
    last = None
    for ms10 in range(100, 501, 20):
        h = ms10 / 10000
        if not ok(model, data, h):
            return last, h
        last = h
    return None
