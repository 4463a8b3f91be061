# mistake: The velocity is summed over the stages, but the position then moves with the new velocity instead of the weighted mean of the stage velocities.
# next: Sum the four stage velocities with weights 1, 2, 2, 1 for the position as well.
# status: incorrect
# told: The position advances with the new velocity alone; use the weighted mean of the four
import mujoco
from mjcourse import model_path


def rk4_step(model, data):
    """Advance data by model.opt.timestep, with accelerations from mujoco.mj_forward alone."""
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    mujoco.mj_forward(model, data)
    v1, a1, w1 = v, data.qacc.copy(), data.act_dot.copy()

    data.qpos[:], data.qvel[:], data.act[:] = q + h / 2 * v1, v + h / 2 * a1, w + h / 2 * w1
    data.time = t + h / 2
    mujoco.mj_forward(model, data)
    v2, a2, w2 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:], data.qvel[:], data.act[:] = q + h / 2 * v2, v + h / 2 * a2, w + h / 2 * w2
    mujoco.mj_forward(model, data)
    v3, a3, w3 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    data.qpos[:], data.qvel[:], data.act[:] = q + h * v3, v + h * a3, w + h * w3
    data.time = t + h
    mujoco.mj_forward(model, data)
    a4, w4 = data.qacc.copy(), data.act_dot.copy()

    acceleration = (a1 + 2 * a2 + 2 * a3 + a4) / 6
    data.act[:] = w + h * (w1 + 2 * w2 + 2 * w3 + w4) / 6
    data.qvel[:] = v + h * acceleration
    data.qpos[:] = q + h * data.qvel


if __name__ == "__main__":
    double_pendulum = mujoco.MjModel.from_xml_path(str(model_path("double_pendulum")))
    double_pendulum.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    mine, theirs = mujoco.MjData(double_pendulum), mujoco.MjData(double_pendulum)
    for data in (mine, theirs):
        mujoco.mj_resetDataKeyframe(double_pendulum, data, 0)
    for _ in range(500):
        rk4_step(double_pendulum, mine)
        mujoco.mj_step(double_pendulum, theirs)
    print(mine.qpos, theirs.qpos)
