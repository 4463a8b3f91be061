"""Forty labs that no author wrote: together they say everything that a lab can say."""

from typing import Any, NamedTuple

HINGE = """<mujoco><option timestep="0.002"><flag energy="enable"/></option><worldbody>
  <body name="rod" pos="0 0 1"><joint name="hinge" axis="0 1 0" damping="0.02"/>
    <geom name="rod" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1" contype="0" conaffinity="0"/>
    <site name="tip" pos="0 0 -0.5"/></body></worldbody>
  <actuator><motor name="torque" joint="hinge" ctrlrange="-5 5"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/></sensor>
  <keyframe><key name="level" qpos="1.5707963"/><key name="moving" qpos="0.3" qvel="2"/></keyframe></mujoco>"""
ARM = """<mujoco><option timestep="0.004" integrator="implicitfast" gravity="0 0 0"/><worldbody>
  <body name="upper"><joint name="q0" axis="0 0 1" damping="0.5"/>
    <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03" contype="0" conaffinity="0"/>
    <body name="fore" pos="0.4 0 0"><joint name="q1" axis="0 0 1" damping="0.5"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" contype="0" conaffinity="0"/>
      <body name="hand" pos="0.3 0 0"><joint name="q2" axis="0 0 1" damping="0.2"/>
        <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.02" contype="0" conaffinity="0"/>
        <site name="palm" pos="0.1 0 0"/></body></body></body></worldbody>
  <actuator><position joint="q0" kp="20"/><position joint="q1" kp="20"/><position joint="q2" kp="5"/></actuator>
  <keyframe><key name="bent" qpos="0.3 0.5 0.7"/></keyframe></mujoco>"""
BALL = """<mujoco><option timestep="0.002"/><worldbody><geom name="floor" type="plane" size="2 2 0.1"/>
  <body name="ball" pos="0 0 0.3"><freejoint name="free"/>
    <geom name="ball" size="0.1" mass="0.5"/></body></worldbody></mujoco>"""
CUBE = """<mujoco><option timestep="0.002" cone="elliptic"/><worldbody>
  <geom name="slope" type="plane" size="2 2 0.1" euler="0 10 0" friction="0.5"/>
  <body name="cube" pos="0 0 0.11" euler="0 10 0"><freejoint/><geom size="0.1 0.1 0.1" type="box" mass="1"/></body>
  </worldbody></mujoco>"""
CART = """<mujoco><option timestep="0.005"/><worldbody><body name="cart" pos="0 0 0.5">
  <joint name="rail" type="slide" axis="1 0 0"/><geom name="cart" type="box" size="0.1 0.05 0.05" mass="1"/>
  <body name="pole"><joint name="pole" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 0.6" size="0.02" mass="0.2"/>
  <site name="top" pos="0 0 0.6"/></body></body></worldbody>
  <actuator><motor name="push" joint="rail"/></actuator>
  <keyframe><key name="tilted" qpos="0 0.1"/></keyframe></mujoco>"""
SPIN = """<mujoco><option timestep="0.001" gravity="0 0 0" integrator="RK4"/><worldbody><body name="plate">
  <freejoint/><geom type="box" size="0.05 0.15 0.3" mass="1"/><site name="corner" pos="0.05 0.15 0.3"/></body>
  </worldbody></mujoco>"""
FINGERS = """<mujoco><asset><model name="finger" file="finger.xml"/></asset><worldbody>
  <body name="palm"><geom size="0.1" mass="1" contype="0" conaffinity="0"/>
  <attach model="finger" body="link" prefix="left-"/>
  <frame pos="0.3 0 0"><attach model="finger" body="link" prefix="right-"/></frame></body></worldbody></mujoco>"""
FINGER = """<mujoco><worldbody><body name="link" pos="0 0 -0.0123456789">
  <joint name="bend" axis="0 1 0" damping="0.01"/>
  <geom type="capsule" fromto="0 0 0 0.2 0 -0.1" size="0.01" mass="0.1" contype="0" conaffinity="0"/>
  <site name="tip" pos="0.2 0 -0.1"/></body></worldbody></mujoco>"""


class MadeUp(NamedTuple):
    """A lab with the model that it runs, what its learner does, and whether it is compared with the WASM build."""

    name: str
    xml: str
    config: dict[str, Any]
    controls: dict[str, Any] | None = None
    events: tuple[tuple[float, str], ...] = ()
    wasm: bool = False


def shown(*expressions: str, **keys: Any) -> dict[str, Any]:
    """Readouts of these expressions, with the lab's other keys."""
    return {"readouts": [{"label": text, "expr": text} for text in expressions], **keys}


def slider(label: str, low: float, high: float, value: float, **keys: Any) -> dict[str, Any]:
    return {"label": label, "min": low, "max": high, "value": value, **keys}


def button(label: str, run: str) -> dict[str, Any]:
    return {"type": "button", "label": label, "run": run}


def traced(*expressions: str, **keys: Any) -> dict[str, Any]:
    return {"traces": [{"label": text, "expr": text} for text in expressions], **keys}


Q, TIP = "data.qpos[0]", "lib.sitePos('tip')"
PD = "data.ctrl[0] = -ctx.kp * data.qpos[0] - ctx.kv * data.qvel[0]"
GAINS = [slider("kp", 0, 20, 5, param="kp"), slider("kv", 0, 2, 0.5, param="kv")]
IIFE = "(() => { let sum = 0; for (let i = 0; i < model.nq; i++) sum += data.qpos[i] ** 2; return sum })()"
BALANCE = "data.ctrl[0] = 12 * data.qpos[1] + 3 * data.qvel[1] + data.qpos[0] + 2 * data.qvel[0]"
TARGETS = "for (let i = 0; i < 3; i++) ctx['q' + i] = 0.2 * (i + 1)"
FOLLOW = "for (let i = 0; i < model.nu; i++) data.ctrl[i] = ctx['q' + i]"
MASS = slider("mass", 0.5, 3, 1, apply="model.body_mass[1] = value; mj.mj_setConst(model, data)", unit="kg")

LABS = [
    MadeUp("pendulum at a keyframe", HINGE, shown(Q, "data.qvel[0]", key="level", seconds=2), wasm=True),
    MadeUp("keyframe by number", HINGE, shown(Q, "data.time", key=1, stopAt=1.5), wasm=True),
    MadeUp("energy", HINGE, shown("lib.energy().total", "lib.energy().kinetic", key=0, seconds=2), wasm=True),
    MadeUp("setup", HINGE, shown(f"{TIP}[0]", f"{TIP}[2]", setup="data.qpos[0] = 1.2", seconds=3), wasm=True),
    MadeUp(
        "slider without a step",
        HINGE,
        shown(Q, key=0, controls=[slider("c", 0, 0.5, 0.1, set="model.dof_damping[0]")], seconds=2),
        {"c": 0.12345},
        wasm=True,
    ),
    MadeUp(
        "slider that moves the start",
        HINGE,
        shown(
            Q,
            setup="data.qpos[0] = 3",
            seconds=2,
            controls=[slider("start", 0, 3, 1, set="data.qpos[0]", init=True, step=0.5, digits=2)],
        ),
        {"start": 2.5},
        wasm=True,
    ),
    MadeUp(
        "slider that resets",
        HINGE,
        shown(Q, key=0, seconds=2, controls=[MASS | {"reset": True}]),
        {"mass": 2},
        wasm=True,
    ),
    MadeUp(
        "controller",
        HINGE,
        shown(Q, "data.ctrl[0]", key=0, controls=GAINS, controller=PD, seconds=2),
        {"kp": 8},
        wasm=True,
    ),
    MadeUp(
        "button",
        HINGE,
        shown(Q, key=1, seconds=2, controls=[button("kick", "data.qvel[0] += 2")]),
        None,
        ((1.0, "kick"),),
        wasm=True,
    ),
    MadeUp(
        "button that plays",
        HINGE,
        shown(Q, TIP + "[0]", seconds=2, controls=[button("go", "data.qpos[0] = 1; sim.play()")]),
        None,
        ((0.5, "go"),),
        wasm=True,
    ),
    MadeUp(
        "select of the integrator",
        HINGE,
        shown(
            Q,
            key=0,
            seconds=2,
            controls=[
                {
                    "type": "select",
                    "label": "method",
                    "set": "model.opt.integrator",
                    "options": [["Euler", 0], ["RK4", 1]],
                    "value": 0,
                    "reset": True,
                }
            ],
        ),
        {"method": "RK4"},
        wasm=True,
    ),
    MadeUp(
        "called at once",
        ARM,
        shown(IIFE, "((a, b) => a - b)(data.qpos[0], data.qpos[1])", key="bent", seconds=2),
        wasm=True,
    ),
    MadeUp(
        "names by number",
        ARM,
        shown("data.qpos[2]", "ctx['q' + 1]", setup=TARGETS, controller=FOLLOW, seconds=2),
        wasm=True,
    ),
    MadeUp(
        "mass matrix", ARM, shown("lib.massMatrix()[0][0]", "lib.massMatrix()[1][2]", key="bent", seconds=1), wasm=True
    ),
    MadeUp(
        "Jacobian",
        ARM,
        shown("lib.jacobian('palm')[0][1]", "lib.jacobian('palm', 2)[5].length", key="bent", seconds=1),
        wasm=True,
    ),
    MadeUp(
        "singular values",
        ARM,
        shown(
            "lib.jacobianSV('palm', {rows: 'pos'})[1]",
            "lib.jacobianSV('palm', {cols: 2})[0]",
            "lib.jacobianSV('palm')[0]",
            key="bent",
            setup=TARGETS,
            controller=FOLLOW,
            seconds=1,
        ),
        wasm=True,
    ),
    MadeUp(
        "numbers of bodies and joints",
        ARM,
        shown(
            "data.xpos[3 * lib.bodyId('hand')]",
            key="bent",
            seconds=1,
            controller="data.qfrc_applied[model.jnt_dofadr[lib.jointId('q1')]] = 0.3",
        ),
        wasm=True,
    ),
    MadeUp("contact pairs", BALL, shown("lib.contactPairs().length", "lib.normalForce('ball')", seconds=2), wasm=True),
    MadeUp(
        "balance",
        CART,
        shown("data.qpos[0]", "lib.sitePos('top')[2]", key="tilted", controller=BALANCE, seconds=2),
        wasm=True,
    ),
    MadeUp(
        "free rotation",
        SPIN,
        shown("data.qvel[4]", "lib.sitePos('corner')[0]", seconds=1, setup="data.qvel[3] = 0.01; data.qvel[4] = 3"),
        wasm=True,
    ),
    MadeUp(
        "attached fingers", FINGERS, shown("lib.qpos('left-bend')", "lib.sitePos('right-tip')[2]", seconds=2), wasm=True
    ),
    MadeUp(
        "sliding cube",
        CUBE,
        shown(
            "lib.norm(data.qvel.slice(0, 3))",
            seconds=1,
            controls=[
                slider("friction", 0, 1, 0.5, apply="for (let i = 0; i < 2; i++) model.geom_friction[3 * i] = value")
            ],
        ),
        {"friction": 0.05},
        wasm=True,
    ),
    MadeUp(
        "arrows of contact forces",
        CUBE,
        {
            "overlays": {"forces": True, "contacts": True},
            "forceScale": 0.02,
            "toggles": ["forces", "contacts", "com"],
            "seconds": 2,
        },
    ),
    MadeUp("every overlay", ARM, {"overlays": ["frames"], "toggles": ["frames", "joints", "com", "sites"], "key": 0}),
    MadeUp(
        "plots with labels and height",
        HINGE,
        {
            "key": 0,
            "plots": [
                traced(
                    Q,
                    xlabel="t",
                    ylabel="rad",
                    height=90,
                    window=4,
                    ymin=-2,
                    ymax=2,
                    refLines=[0, {"expr": "model.nv", "label": "one"}, "model.nq / 2"],
                )
            ],
        },
    ),
    MadeUp(
        "two plots, one without a window", HINGE, {"plots": [traced(Q), traced("data.qvel[0]", window=2)], "key": 0}
    ),
    MadeUp(
        "dashed and coloured traces",
        HINGE,
        {
            "plots": [
                {
                    "traces": [
                        {"label": "a", "expr": Q, "dash": [4, 2]},
                        {"label": "b", "expr": "-data.qpos[0]", "dash": True, "color": "#c00"},
                    ]
                }
            ],
            "key": "moving",
        },
    ),
    MadeUp(
        "trail by name", HINGE, {"trail": "tip", "key": 0, "camera": {"azimuth": -90, "elevation": 5, "distance": 2}}
    ),
    MadeUp(
        "trail of a body", ARM, {"trail": {"body": "hand"}, "key": 0, "height": 200, "title": "A hand", "note": "Look."}
    ),
    MadeUp("trail of a geom", BALL, {"trail": {"geom": "ball"}, "autoplay": True, "dock": True}),
    MadeUp("trail of an expression", CART, {"trail": {"expr": "[data.qpos[0], 0, 1]"}, "key": 0}),
    MadeUp("stops at a condition", HINGE, shown(Q, key=0, stopAt="data.qpos[0] < 0")),
    MadeUp(
        "text readout with digits",
        HINGE,
        {
            "key": 0,
            "readouts": [
                {"label": "side", "expr": f"{Q} > 0 ? 'left' : 'right'"},
                {"label": "q", "expr": Q, "digits": 1, "unit": "rad"},
            ],
        },
    ),
    MadeUp(
        "a readout that fails at first",
        HINGE,
        shown("ctx.list.length", key=0, seconds=1, controls=[button("make", "ctx.list = [1, 2]")]),
        None,
        ((0.5, "make"),),
    ),
    MadeUp(
        "select of a text and of an array",
        HINGE,
        shown(
            "ctx.name",
            "ctx.at[1]",
            controls=[
                {"type": "select", "label": "n", "param": "name", "options": [["a", "x"], ["b", "y"]]},
                {"type": "select", "label": "a", "param": "at", "options": [["none", [0, 0]], ["some", [1, 2]]]},
            ],
        ),
        {"a": "some"},
    ),
    MadeUp(
        "functions as arguments",
        ARM,
        shown(
            "Array.from(data.qpos).map(function (x) { return 2 * x })[1]", "data.qpos.reduce((a, b) => a + b, 0)", key=0
        ),
    ),
    MadeUp(
        "a function expression called at once", HINGE, shown("(function (a) { return a * a })(data.qpos[0])", key=0)
    ),
    MadeUp("contacts as text", CUBE, shown("lib.contactPairs().join(', ') || 'none'", "lib.contacts()", seconds=1)),
    MadeUp(
        "forward in a button",
        HINGE,
        shown(
            "lib.sitePos('tip')[0]",
            "lib.sensor('angle')",
            seconds=1,
            controls=[button("up", "data.qpos[0] = 3; sim.forward(); sim.pause()")],
        ),
        None,
        ((0.9, "up"),),
    ),
    MadeUp(
        "what the learner set is kept",
        BALL,
        shown(
            "lib.bodyVel('ball')[2]",
            "ctx['h']",
            controls=[
                slider("h", 0.1, 1, 0.3, apply="ctx['h'] = value; data.qpos[2] = value", init=True),
                slider("g", -20, 0, -9.81, set="model.opt.gravity[2]", unit="m/s²"),
            ],
        ),
        {"h": 0.777},
    ),
]
