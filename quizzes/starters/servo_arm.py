"""Hold an arm at an angle. What is here runs, but lets the arm hang.

Try it on your own machine first:  python servo_arm.py
"""

import mujoco
from mjcourse import model_path


def control(model, data, target):
    """Return the torque in N m; data is a copy of the arm's state, so that only what you return acts."""
    # 1. A spring to the target, and a damper.
    # 2. What does gravity ask for? See data.qfrc_bias.
    return 0.0


if __name__ == "__main__":
    arm = mujoco.MjModel.from_xml_path(str(model_path("servo_arm")))
    state = mujoco.MjData(arm)
    while state.time < 3:
        mujoco.mj_forward(arm, state)
        state.ctrl[:] = control(arm, state, 1.2)
        mujoco.mj_step(arm, state, 2)
    print(f"angle after 3 s: {state.qpos[0]:.3f} rad, the target is 1.2 rad")
