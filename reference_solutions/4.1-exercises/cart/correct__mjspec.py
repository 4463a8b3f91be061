"""Made with MjSpec."""

import mujoco


def make_cart(mass, height, gear):
    spec = mujoco.MjSpec()
    cart = spec.worldbody.add_body(name="cart", pos=[0, 0, 1])
    cart.add_joint(name="rail", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], damping=0.5)
    cart.add_geom(name="cart", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 0.1, 0.05], mass=2)
    pole = cart.add_body(name="pole", explicitinertial=True, mass=mass, ipos=[0, 0, height], inertia=[0.02, 0.02, 0.001])
    pole.add_joint(name="hinge", axis=[0, 1, 0], damping=0.01)
    push = spec.add_actuator(name="push", target="rail", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    push.gear[0] = gear
    push.ctrllimited = True
    push.ctrlrange = [-1, 1]
    return spec
