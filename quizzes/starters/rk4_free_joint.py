"""Your Runge-Kutta step, extended to free and ball joints.

A free joint has 7 positions (3 for the place, 4 for a unit quaternion) but 6 velocities, a ball joint 4 and 3; so
qpos + h * qvel does not even have a length. mujoco.mj_integratePos(model, qpos, velocity, h) moves qpos, IN PLACE, for
a time h at a constant velocity, and knows about quaternions. Where an actuator has one, data.act is a state too (its
slope is data.act_dot), and time runs along. What is here runs, but is only semi-implicit Euler.
"""

import mujoco

SCENE = """
<mujoco>
  <worldbody>
    <site name="hook" pos="0 0 1.5"/>
    <body name="box" pos="0 0 1">
      <freejoint/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.02 0.025"/>
      <site name="corner" pos="0.1 0.1 0.1"/>
    </body>
  </worldbody>
  <tendon>
    <spatial stiffness="50" springlength="0.3"><site site="hook"/><site site="corner"/></spatial>
  </tendon>
</mujoco>
"""


def rk4_step(model, data):
    """Advance data by model.opt.timestep, with accelerations from mujoco.mj_forward alone."""
    h = model.opt.timestep
    q, v = data.qpos.copy(), data.qvel.copy()

    mujoco.mj_forward(model, data)
    new_v = v + h * data.qacc

    data.qpos[:] = q  # mj_integratePos works in place: begin from a copy, at every stage
    mujoco.mj_integratePos(model, data.qpos, new_v, h)
    data.qvel[:] = new_v
    data.time += h


if __name__ == "__main__":
    box = mujoco.MjModel.from_xml_string(SCENE)
    box.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    mine, theirs = mujoco.MjData(box), mujoco.MjData(box)
    mine.qvel[3:], theirs.qvel[3:] = (3, -2, 4), (3, -2, 4)
    for _ in range(500):
        rk4_step(box, mine)
        mujoco.mj_step(box, theirs)
    print(f"difference from MuJoCo's RK4 after 1 s: {abs(mine.qpos - theirs.qpos).max():.1e}")
