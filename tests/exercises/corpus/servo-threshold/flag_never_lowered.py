# mistake: The attribute `unstable` is raised by the first unstable run and never lowered, so every later run counts as unstable.
# next: Set it to False at the start of each run.
# status: incorrect
# told: After your first unstable run every later one counts as unstable
import mujoco


class Experiment:
    unstable = False

    def __init__(self, model, integrator):
        self.m = model
        self.m.opt.integrator = integrator

    def run(self, h):
        self.m.opt.timestep = h
        d = mujoco.MjData(self.m)
        d.qpos[0] = 1
        t_old = 0.0
        for _ in range(int(3 / h) + 1):
            mujoco.mj_step(self.m, d)
            if d.time < t_old:
                self.unstable = True
                break
            t_old = d.time


def largest_stable_timestep(model, integrator):
    experiment = Experiment(model, integrator)
    lo, hi = 0.001, 0.05
    experiment.run(hi)
    if not experiment.unstable:
        return None
    while hi - lo > 0.0005:
        h = (lo + hi) / 2
        experiment.run(h)
        if experiment.unstable:
            hi = h
        else:
            lo = h
    return lo, hi
