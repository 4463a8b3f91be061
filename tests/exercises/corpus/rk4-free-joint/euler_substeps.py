# mistake: Four Euler steps of h/4 were taken for the four stages of Runge-Kutta; it is still semi-implicit Euler, of first order.
# next: Compute four slopes, each from the start of the step, and sum them with weights 1, 2, 2, 1 over 6.
# status: incorrect
# told: Your stage 2 moves the position with its own new velocity; use the velocity of the stage
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    for k in range(4):
        mujoco.mj_forward(model, data)
        data.qvel[:] += h / 4 * data.qacc
        data.act[:] += h / 4 * data.act_dot
        mujoco.mj_integratePos(model, data.qpos, data.qvel, h / 4)
        data.time += h / 4
