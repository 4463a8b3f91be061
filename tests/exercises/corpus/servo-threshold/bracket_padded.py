# mistake: The bracket is widened by 2 ms either way "to be safe", so it is too wide.
# next: Return the two ends of the bisection themselves.
# status: incorrect
# told: at 20.14 ms MuJoCo warned; but you return 17.76 and 22.14 ms
import mujoco

SAFETY = 0.002


def simulate(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    clock = 0.0
    for _ in range(round(3 / h)):
        mujoco.mj_step(model, data)
        if data.time < clock:
            return "unstable"
        clock = data.time
    return "stable"


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    bounds = {"stable": 0.001, "unstable": 0.05}
    if simulate(model, 0.05) == "stable":
        return None
    while bounds["unstable"] - bounds["stable"] > 0.0005:
        mid = (bounds["stable"] + bounds["unstable"]) / 2
        bounds[simulate(model, mid)] = mid
    return bounds["stable"] - SAFETY, bounds["unstable"] + SAFETY
