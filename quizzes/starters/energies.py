"""Compare what two integrators do to the energy. What is here runs, but measures nothing.

Try it on your own machine first:  python energies.py
"""

import mujoco
from mjcourse import model_path


def energies(model, data):
    """Return the range of the total energy [J] in 1500 steps under Euler and under implicit, from the state of `data`."""
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    # For each integrator: start from the given state, take 1500 steps, and keep data.energy.sum().
    return {"euler": 0.0, "implicit": 0.0}


if __name__ == "__main__":
    double_pendulum = mujoco.MjModel.from_xml_path(str(model_path("double_pendulum")))
    state = mujoco.MjData(double_pendulum)
    mujoco.mj_resetDataKeyframe(double_pendulum, state, 0)
    print(energies(double_pendulum, state))
