# mistake: It returns the damping limit 2 I / kv of the lesson, which ignores the spring.
# next: Simulate the given model and bisect: spring and damper act together.
# status: incorrect
# told: You reported the damping bound 2*I/kv, which ignores the spring
import mujoco


def largest_stable_timestep(model, integrator):
    d = mujoco.MjData(model)
    mujoco.mj_forward(model, d)
    M = [[0.0]]
    import numpy as np
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, d, M)
    I = M[0, 0]
    kv = -model.actuator_biasprm[0, 2]
    h = 2 * I / kv
    if integrator != 0 or h > 0.05:
        return None
    return h
