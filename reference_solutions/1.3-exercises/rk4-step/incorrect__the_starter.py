# diagnosis: semi-implicit Euler
"""Your own fourth-order Runge-Kutta step, for models without quaternions.

What is here runs, but it is only semi-implicit Euler: one acceleration a step. Make it the classical method:

    k1 = slope at the start of the step           k2 = slope at its middle, reached with k1
    k3 = slope at its middle, reached with k2     k4 = slope at its end, reached with k3
    new state = old state + h (k1 + 2 k2 + 2 k3 + k4) / 6

The state is (qpos, qvel), and act where an actuator has one; its slope is (qvel, qacc, act_dot); time runs along.
Try it on your own machine first:  python rk4_step.py
"""

import mujoco
from mjcourse import model_path


def rk4_step(model, data):
    """Advance data by model.opt.timestep, with accelerations from mujoco.mj_forward alone."""
    h = model.opt.timestep
    # data.qpos, data.qvel and data.qacc are views into data: the next mj_forward overwrites them. Keep copies:
    q, v = data.qpos.copy(), data.qvel.copy()

    mujoco.mj_forward(model, data)  # reads qpos, qvel, act, ctrl and time; fills qacc and act_dot
    acceleration = data.qacc.copy()

    data.qvel[:] = v + h * acceleration
    data.qpos[:] = q + h * data.qvel
    data.time += h


if __name__ == "__main__":
    double_pendulum = mujoco.MjModel.from_xml_path(str(model_path("double_pendulum")))
    double_pendulum.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    mine, theirs = mujoco.MjData(double_pendulum), mujoco.MjData(double_pendulum)
    worst = 0.0
    for data in (mine, theirs):
        mujoco.mj_resetDataKeyframe(double_pendulum, data, 0)
    for _ in range(500):
        rk4_step(double_pendulum, mine)
        mujoco.mj_step(double_pendulum, theirs)
        worst = max(worst, abs(mine.qpos - theirs.qpos).max())
    print(f"largest difference from MuJoCo's RK4 over 1 s: {worst:.1e} (1e-10 is the aim)")
