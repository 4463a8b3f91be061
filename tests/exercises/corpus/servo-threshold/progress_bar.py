# mistake: It imports tqdm for a progress bar, a package that the course does not have.
# next: Use NumPy, MuJoCo and the standard library alone.
# status: crashed
# told: ModuleNotFoundError: No module named 'tqdm', in line 5 of your
import mujoco
from tqdm import tqdm


def is_stable(model, integrator, h):
    model.opt.integrator = integrator
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in tqdm(range(round(3 / h))):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    lo, hi = 0.001, 0.05
    if is_stable(model, integrator, hi):
        return None
    while hi - lo > 0.0005:
        mid = (lo + hi) / 2
        if is_stable(model, integrator, mid):
            lo = mid
        else:
            hi = mid
    return lo, hi
