# diagnosis: The body 'pole' weighs as much as its geoms of 1000 kg/m^3
import mujoco

def make_cart(mass, height, gear):
    s = mujoco.MjSpec()
    s.option.timestep = 2e-3
    s.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    cart = s.worldbody.add_body(name="cart", pos=[0, 0, 1])
    cart.add_joint(name="rail", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], damping=0.5)
    cart.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 0.1, 0.05], mass=2)
    pole = cart.add_body(name="pole", mass=mass, ipos=[0, 0, height], inertia=[0.02, 0.02, 0.001], explicitinertial=False)
    pole.add_joint(name="hinge", axis=[0, 1, 0], damping=0.01)
    pole.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[0, 0, 0, 0, 0, 1.5 * height], size=[0.02, 0, 0])
    a = s.add_actuator(name="push", target="rail", trntype=mujoco.mjtTrn.mjTRN_JOINT, ctrlrange=[-1, 1], ctrllimited=True)
    a.gear[0] = gear
    a.set_to_motor()
    return s
