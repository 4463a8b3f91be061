"""Keys of numeric questions: by a threshold, a measurement, or a closed form."""

from collections.abc import Callable
from math import isfinite

import mujoco

from grader.certify.certificate import Certificate, of_number, refused
from grader.domain.lab import LabConfig, Readout
from grader.domain.quiz import NumericQuestion
from grader.domain.verify import ByExpression, ByMeasurement, ByThreshold, Servo
from grader.grading.units import convert, known_unit
from grader.labs.expressions import compile_expression
from grader.labs.integrators import INTEGRATORS
from grader.labs.machine import Machine
from grader.labs.run import run_lab
from grader.labs.running import Variant
from grader.labs.values import to_number
from grader.numerics.scene import Scene
from grader.numerics.search import find_threshold, spectral_limit

NUDGE = 1e-10
DECAY_STEPS = 20_000
CHUNK = 100
"""Steps between two looks at the speed."""

MARGIN = 0.1
"""Stepping is tried this share of the tolerance, or of the limit where that is less, below and above the limit."""

EMPTY = "<mujoco/>"
ModelXml = Callable[[str], str]


def certify_threshold(question: NumericQuestion, verify: ByThreshold, model_xml: ModelXml) -> Certificate:
    """The largest stable timestep: for ever by the spectral radius, confirmed by stepping; or by warnings."""
    if question.tolerance == 0:
        why = "the tolerance is 0, and no limit is known that well: give tol"
        return refused("threshold", question.answer, why, key="tol")
    scene = _scene(verify, model_xml)
    scale = verify.scale if verify.scale is not None else _per_second(question)
    measure = _decays if verify.criterion == "decays" else _warns
    found = measure(scene, verify, question.tolerance / scale)
    if isinstance(found, str):
        return refused("threshold", question.answer, found)
    low, high = (scale * h for h in found)
    measured = {
        "criterion": verify.criterion,
        "integrator": verify.integrator,
        "stable at": low,
        "unstable at": high,
        "unit": question.unit,
    }
    derived, uncertainty = 0.5 * (low + high), 0.5 * (high - low)
    return of_number("threshold", question, derived, uncertainty, measured)


def _per_second(question: NumericQuestion) -> float:
    """A second in the question's unit; 1 where that is no unit of time."""
    unit, second = known_unit(question.unit or "s"), known_unit("s")
    assert second is not None
    try:
        return convert(1.0, second, unit) if unit is not None else 1.0
    except Exception as error:
        raise ValueError(f"the unit {question.unit!r} is none of time: write verify.scale") from error


def _scene(verify: ByThreshold, model_xml: ModelXml) -> Scene:
    if verify.servo is not None:
        scene = Scene.from_xml(servo_xml(verify.servo)).at(qvel=[1.0])
    else:
        scene = Scene.from_xml(named_xml(verify.model, verify.xml, model_xml))
    if verify.set:
        scene = scene.changed(lambda model: _write(model, verify.set))
    return scene.at(key=verify.key, qpos=verify.qpos, qvel=verify.qvel)


def _write(model: mujoco.MjModel, fields: dict[str, float]) -> None:
    """Set fields of the model by the lab's own paths, such as model.dof_damping[0], and what MuJoCo derives of them."""
    data = mujoco.MjData(model)
    machine = Machine(model, data)
    for path, value in fields.items():
        compile_expression(f"{path} = value", "statement", "verify.set").run(machine, value)
    mujoco.mj_setConst(model, data)


def named_xml(model: str | None, xml: str | None, model_xml: ModelXml) -> str:
    """The MJCF that a `verify` names. Raises ValueError where it names none."""
    if xml is not None:
        return xml
    if model is None:
        raise ValueError("verify needs a model or an xml")
    return model_xml(model)


def servo_xml(servo: Servo) -> str:
    """A hinge of that inertia, held by that servo, without gravity."""
    i = servo.inertia
    return f"""
    <mujoco><option gravity="0 0 0"/><worldbody><body>
      <inertial pos="0 0 0" mass="1" diaginertia="{i!r} {i!r} {i!r}"/><joint name="hinge" axis="0 1 0"/>
    </body></worldbody>
    <actuator><general joint="hinge" biastype="affine" gainprm="{servo.kp!r}" biasprm="0 {-servo.kp!r} {-servo.kv!r}"/>
    </actuator></mujoco>"""


def _decays(scene: Scene, verify: ByThreshold, tolerance_s: float) -> tuple[float, float] | str:
    """A bracket of the limit for ever: the spectral radius passes 1 in it; stepping decays below and grows above."""
    integrator = INTEGRATORS[verify.integrator]
    limit = spectral_limit(scene, low_s=verify.low, high_s=verify.high, integrator=integrator)
    if limit is None or limit <= verify.low:
        return f"the spectral radius does not pass 1 between {verify.low:g} and {verify.high:g} s"
    margin = MARGIN * min(tolerance_s, limit)
    low, high = limit - margin, limit + margin
    for timestep_s, stable in ((low, True), (high, False)):
        if _decays_stepping(scene, timestep_s, integrator) is not stable:
            stepped = "does not decay" if stable else "still decays"
            return f"the spectral radius passes 1 at {limit:.9g} s, but stepping {stepped} at {timestep_s:.9g} s"
    return low, high


def _decays_stepping(scene: Scene, timestep_s: float, integrator: int) -> bool:
    """Whether the highest speed of the last quarter of many steps is below that of the first.

    Every motion away from rest shows in the speed sooner or later, also one that starts at speed 0; the position
    itself may come to rest elsewhere, where nothing pulls it back. Raises ValueError where nothing moves.
    """
    speeds = []
    with scene.borrow(timestep_s=timestep_s, integrator=integrator) as workspace:
        for _ in range(DECAY_STEPS // CHUNK):
            speeds.append(float(abs(workspace.data.qvel).max(initial=0.0)))
            mujoco.mj_step(workspace.model, workspace.data, nstep=CHUNK)
            if workspace.counts.any():
                return False
    first, last = max(speeds[: len(speeds) // 4]), max(speeds[-len(speeds) // 4 :])
    if first == 0:
        raise ValueError("nothing moves from this start: give a key, qpos or qvel that is not at rest")
    return last < first


def _warns(scene: Scene, verify: ByThreshold, tolerance_s: float) -> tuple[float, float] | str:
    """The bracket in which warnings begin within the horizon."""
    found = find_threshold(
        scene,
        low_s=verify.low,
        high_s=verify.high,
        horizon_s=verify.seconds,
        integrator=INTEGRATORS[verify.integrator],
        width_s=MARGIN * tolerance_s,
    )
    return found.bracket_s or found.reason


def certify_measurement(question: NumericQuestion, verify: ByMeasurement, model_xml: ModelXml) -> Certificate:
    """The value at h, h/2 and h/4, and from starts nudged a little: what they differ by is the uncertainty."""
    config = LabConfig(
        model=verify.model,
        xml=verify.xml,
        key=verify.key,
        setup=verify.setup,
        controller=verify.controller,
        readouts=(Readout(label="value", expr=verify.expr),),
    )
    xml = named_xml(verify.model, verify.xml, model_xml)
    every = verify.when != "end"

    def value(variant: Variant) -> float:
        run = run_lab(config, xml, seconds=verify.seconds, variant=variant)
        if run.warnings:
            raise ValueError(f"MuJoCo warned of {run.warnings[0].kind} at {run.warnings[0].time_s:g} s")
        return _summary([to_number(v) for v in run.readouts[0]], verify.when)

    at = {f"h/{finer}": value(Variant(finer=finer, every_step=every)) for finer in (1, 2, 4)}
    nudged = [value(Variant(nudge=nudge, every_step=every)) for nudge in (NUDGE, -NUDGE)]
    best = at["h/4"]
    uncertainty = max(abs(best - at["h/1"]), *(abs(at["h/1"] - v) for v in nudged))
    measured = {**at, "nudged": nudged, "unit": question.unit}
    if not isfinite(best):
        return refused("measurement", question.answer, f"the measured value is {best}", key="verify.expr")
    return of_number("measurement", question, best, uncertainty, measured)


def _summary(values: list[float], when: str) -> float:
    if when == "end":
        return values[-1]
    return max(values) if when == "max" else min(values) if when == "min" else sum(values) / len(values)


def certify_expression(question: NumericQuestion, verify: ByExpression, model_xml: ModelXml) -> Certificate:
    """The value of a closed form."""
    named = verify.model or verify.xml
    xml = named_xml(verify.model, verify.xml, model_xml) if named else EMPTY
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    value = to_number(compile_expression(verify.expr, "expression", "verify.expr").run(Machine(model, data)))
    if not isfinite(value):
        return refused("expression", question.answer, f"the closed form gives {value}", key="verify.expr")
    return of_number("expression", question, value, 0.0, {"value": value})
