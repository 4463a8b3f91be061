"""Small scenes, one feature each; every one of them moves. The lesson's three are read from models/."""

from pathlib import Path

MODELS = Path(__file__).parents[2] / "models"
LESSON = {name: (MODELS / f"{name}.xml").read_text() for name in ("pendulum", "pendulum_servo", "double_pendulum")}


def hinge(inside: str = "", body: str = "", rest: str = "") -> str:
    """A single pendulum about +y with extra attributes or elements."""
    return f"""
    <mujoco><compiler angle="radian"/><worldbody>
      <body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0" {inside}/>
        <inertial pos="0 0 -0.5" mass="1" diaginertia="1e-3 1e-3 1e-3"/>{body}
        <site name="tip" pos="0 0 -0.5"/></body>
    </worldbody>{rest}</mujoco>"""


SPHERE = '<geom type="sphere" size="0.1" mass="1"/>'
FLOOR = '<geom name="floor" type="plane" size="2 2 0.1"/>'

FREE_BODY = """
<mujoco><option gravity="0 0 0"/><worldbody><body name="body" pos="0 0 1"><freejoint name="root"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.2 0.3"/></body></worldbody>
  <keyframe><key name="spin" qpos="0 0 1 1 0 0 0" qvel="0.1 0 0 1 2 3"/></keyframe></mujoco>"""

SPRUNG_BODY = """
<mujoco><worldbody><site name="anchor" pos="0 0 2"/><body name="body" pos="0 0 1"><freejoint name="root"/>
  <inertial pos="0.05 0.02 0" mass="1" diaginertia="0.1 0.2 0.28"/><site name="hook" pos="0.2 0.1 0.1"/></body>
</worldbody><tendon><spatial name="spring" stiffness="40" springlength="0.5"><site site="anchor"/><site site="hook"/>
</spatial></tendon>
<keyframe><key name="spin" qpos="0 0 1 1 0 0 0" qvel="0.1 0 0 1 2 3"/></keyframe></mujoco>"""

BALL = """
<mujoco><worldbody><body name="body" pos="0 0 1"><joint name="ball" type="ball" damping="0.01"/>
  <inertial pos="0 0.1 -0.4" mass="1" diaginertia="0.02 0.03 0.04"/></body></worldbody>
  <keyframe><key name="spin" qpos="0.9 0.3 0.2 0.1" qvel="1 2 0.5"/></keyframe></mujoco>"""

TWO_FREE_BODIES = f"""
<mujoco><worldbody>{FLOOR}
  <body pos="0 0 0.35"><freejoint/><geom type="box" size="0.1 0.15 0.2" mass="1"/></body>
  <body pos="0.12 0.05 0.8"><freejoint/><geom type="box" size="0.2 0.1 0.1" mass="2"/></body>
</worldbody></mujoco>"""

LINK = '<geom type="capsule" size="0.01" fromto="0 0 0 0 0 -0.1" contype="0" conaffinity="0"/>'
STIFF_CHAIN = f"""
<mujoco><option solver="CG"/><default><joint limited="true" range="-5 5" frictionloss="0.002"/></default><worldbody>
  <body pos="0 0 -0.1"><joint axis="0 1 0"/>{LINK}<body pos="0 0 -0.1"><joint axis="1 0 0"/>{LINK}
  <body pos="0 0 -0.1"><joint axis="0 1 0"/>{LINK}<body pos="0 0 -0.1"><joint axis="1 0 0"/>{LINK}
</body></body></body></body></worldbody></mujoco>"""

CUBE = f"""
<mujoco><worldbody>{FLOOR}
  <body pos="0 0 0.3" euler="20 30 0"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body>
</worldbody></mujoco>"""

EXCLUDED_PAIR = """
<mujoco><worldbody>
  <body name="a" pos="0 0 1"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.05"/></body>
  <body name="b" pos="0.3 0 0.6"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.05"/></body>
</worldbody><contact><exclude body1="b" body2="a"/></contact></mujoco>"""

EXPLICIT_PAIR = """
<mujoco><worldbody><geom name="ground" type="plane" size="1 1 0.1" contype="0" conaffinity="0"/>
  <body pos="0 0 0.3"><freejoint/><geom name="ball" type="sphere" size="0.1" contype="0" conaffinity="0"/></body>
</worldbody><contact><pair geom1="ground" geom2="ball"/></contact></mujoco>"""

PARENT_AND_CHILD = """
<mujoco><worldbody><body pos="0 0 2"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.05"/>
  <body pos="0 0 -0.4"><joint axis="0 1 0" damping="0.1"/><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.05"/>
  </body></body></worldbody></mujoco>"""

EQUALITY = """
<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="a" axis="0 1 0"/><geom size="0.1" mass="1" pos="0 0 -0.5"
  contype="0" conaffinity="0"/></body><body name="b" pos="1 0 1"><joint name="b" axis="0 1 0"/><geom size="0.1" mass="1"
  pos="0 0 -0.5" contype="0" conaffinity="0"/></body></worldbody>
  <equality><joint joint1="a" joint2="b" polycoef="0.2 1 0 0 0"/></equality></mujoco>"""

INACTIVE_WELD = """
<mujoco><worldbody><body name="a" pos="0 0 1"><joint axis="0 1 0"/><inertial pos="0 0 -0.5" mass="1"
  diaginertia="1e-3 1e-3 1e-3"/></body></worldbody><equality><weld body1="a" active="false"/></equality></mujoco>"""

MOCAP = """
<mujoco><worldbody><body name="hand" mocap="true" pos="0.2 0 1.3"><geom size="0.02" contype="0" conaffinity="0"/></body>
  <body name="a" pos="0 0 1"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.02 0.02"/></body>
</worldbody><equality><connect body1="hand" body2="a" anchor="0 0 -0.3"/></equality></mujoco>"""

MOCAP_ALONE = """
<mujoco><worldbody><body name="hand" mocap="true" pos="0 0 1.3"><geom size="0.1"/></body>
  <body name="a" pos="0 0 1.6"><freejoint/><geom size="0.1" mass="1"/></body></worldbody></mujoco>"""

TENDON_LIMIT = """
<mujoco><compiler autolimits="true"/><worldbody><site name="s0" pos="0 0 1.5"/><body pos="0 0 1"><joint name="a"
  axis="0 1 0"/><inertial pos="0 0 -0.5" mass="1" diaginertia="1e-3 1e-3 1e-3"/>
  <site name="s1" pos="0.3 0 -0.3"/></body></worldbody>
<tendon><spatial range="0 0.85" frictionloss="0.1" damping="0.1"><site site="s0"/><site site="s1"/></spatial></tendon>
</mujoco>"""

SENSORS = hinge(
    rest="""<sensor><jointpos joint="hinge"/><jointvel joint="hinge"/><framepos objtype="site" objname="tip"/>
    <accelerometer site="tip"/><gyro site="tip"/></sensor>"""
)

ACTIVATIONS = hinge(
    "damping='0.05'",
    rest="""<actuator><general joint="hinge" dyntype="filter" dynprm="0.03" gainprm="2"/>
    <general joint="hinge" dyntype="filterexact" dynprm="0.02" gainprm="1" actlimited="true" actrange="-0.5 0.5"/>
    <intvelocity joint="hinge" kp="3" kv="0.2" actrange="-1 1"/><motor joint="hinge"/></actuator>""",
)

FLEX = """
<mujoco><worldbody><body name="cloth" pos="0 0 1"><flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.1 0.1 0.1"
  mass="0.2" dim="2" radius="0.005"><contact selfcollide="none" contype="0" conaffinity="0"/>
  <edge equality="true" damping="0.01"/></flexcomp></body></worldbody></mujoco>"""

FLUID = """
<mujoco><option density="1.2" viscosity="0.02" wind="1 0 0"/><worldbody><body pos="0 0 1"><freejoint/>
  <geom type="box" size="0.3 0.2 0.01" mass="0.1" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""

GRAVITY_OFF = hinge("stiffness='3' springref='1' damping='0.1'", rest="<option gravity='0 0 0'/>")

OWN = {
    "free_body": FREE_BODY,
    "sprung_body": SPRUNG_BODY,
    "ball": BALL,
    "two_free_bodies": TWO_FREE_BODIES,
    "cube": CUBE,
    "stiff_chain": STIFF_CHAIN,
    "excluded_pair": EXCLUDED_PAIR,
    "explicit_pair": EXPLICIT_PAIR,
    "parent_and_child": PARENT_AND_CHILD,
    "equality": EQUALITY,
    "inactive_weld": INACTIVE_WELD,
    "mocap": MOCAP,
    "mocap_alone": MOCAP_ALONE,
    "joint_limit": hinge("limited='true' range='-0.3 0.4'"),
    "tendon_limit": TENDON_LIMIT,
    "friction_loss": hinge("frictionloss='0.02'"),
    "spring": hinge("stiffness='5' springref='0.3'"),
    "damper": hinge("damping='0.4'"),
    "gravity_compensation": hinge("").replace('name="arm"', 'name="arm" gravcomp="0.7"'),
    "gravity_off": GRAVITY_OFF,
    "fluid": FLUID,
    "sensors": SENSORS,
    "activations": ACTIVATIONS,
    "flex": FLEX,
}

DELAY = hinge("damping='0.5'", rest="<actuator><position joint='hinge' kp='20' delay='0.01' nsample='20'/></actuator>")
RUNAWAY = hinge(
    rest="""<actuator><general joint="hinge" biastype="affine" biasprm="0 0 60" gainprm="1"/></actuator>
    <keyframe><key qpos="0.1"/></keyframe>"""
)

ALL = LESSON | OWN
