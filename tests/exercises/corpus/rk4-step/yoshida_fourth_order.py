# mistake: This is Yoshida's symplectic method of fourth order (three leapfrogs), not the classical Runge-Kutta method.
# next: Take k1 to k4 as the question gives them.
# status: incorrect
# told: positions and velocities move in turn, as in a leapfrog
import mujoco

W1 = 1 / (2 - 2 ** (1 / 3))
W0 = -(2 ** (1 / 3)) * W1
C = (W1 / 2, (W0 + W1) / 2, (W0 + W1) / 2, W1 / 2)
D = (W1, W0, W1, 0.0)


def rk4_step(model, data):
    """4th order, 3 force evaluations; conserves energy better than RK4."""
    h = model.opt.timestep
    t = data.time
    for c, d in zip(C, D):
        data.qpos[:] += c * h * data.qvel
        data.time += c * h
        if d:
            mujoco.mj_forward(model, data)
            data.qvel[:] += d * h * data.qacc
            data.act[:] += d * h * data.act_dot
    data.time = t + h
