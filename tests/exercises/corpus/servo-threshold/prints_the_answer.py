# mistake: The bracket is printed and not returned, so the function returns None.
# next: Return (low, high).
# status: incorrect
# told: Your function prints its
import mujoco

def is_stable(model, integrator, timestep):
    model.opt.integrator = integrator
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(3.0 / timestep)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return False
    return True


def largest_stable_timestep(model, integrator):
    if is_stable(model, integrator, 0.05):
        print("stable everywhere")
        return
    low, high = 0.001, 0.05
    while high - low > 0.0005:
        mid = (low + high) / 2
        if is_stable(model, integrator, mid):
            low = mid
        else:
            high = mid
    print(f"largest stable timestep: {low * 1000:.2f} ms, unstable: {high * 1000:.2f} ms")
