"""Certifies largest stable timesteps."""

from dataclasses import dataclass, replace
from math import log

import mujoco
import numpy as np

from grader.certify.certificate import Certificate, certify_number, refuse
from grader.domain.verify import ByThreshold, ServoJoint
from grader.experiments.runs import VerifyError, read_xml, set_fields
from grader.numerics.integrators import BY_NAME, INTEGRATORS
from grader.numerics.scene import Scene
from grader.numerics.stability.bisection import SearchResult, Threshold, find_threshold
from grader.numerics.stability.equilibrium import find_equilibrium_of_motion
from grader.numerics.stability.limit import find_spectral_limit
from grader.numerics.stability.linear import compute_spectral_radius
from grader.questions import ModelXml, NumberKey
from grader.questions.kinds.number.units import convert, known_unit

STEPS_MIN, STEPS_MAX = 20_000, 400_000
"""Steps that are tried from the start of the question: enough for clear growth on the unstable side."""

GROWN = 1.5
"""Growth of the highest speed from the first quarter of the steps to the last which counts as instability.

Undamped motion keeps its speed up to a few percent: readings meet the phases of the motion by chance.
"""

CLEAR = 20.0
"""Growth that is waited for, as the spectral radius foretells it."""

READINGS = (100, 320)
"""The fewest and the most readings of the speed. The steps between two are drawn: a motion whose period divides a
constant number would always be read in the same phase."""

SMALL = 1e-6
"""Speed of every joint [rad/s, m/s] near the equilibrium: far above rounding, and small enough to be linear."""

MARGIN = 0.1
"""Distance from the limit at which stepping is tried: this share of the tolerance or of the limit, if smaller."""

LINEAR = "the linear stability limit"


def certify_threshold(key: NumberKey, verify: ByThreshold, model_xml: ModelXml) -> Certificate:
    """Derive the largest stable timestep: the linear stability limit, confirmed by stepping, or the first warning."""
    if key.tolerance == 0:
        why = "the tolerance is 0, and no limit can be known exactly: give tol"
        return refuse("threshold", key.answer, why, key="tol")
    scene = _build_scene(verify, model_xml)
    scale = verify.scale if verify.scale is not None else _convert_second(key)
    limit = _find_limit(scene, verify, key.tolerance / scale)
    if isinstance(limit, str):
        return refuse("threshold", key.answer, limit)
    low, high = (scale * h for h in limit.bracket_s)
    measured = {
        "criterion": verify.criterion,
        "compared with": limit.name,
        "integrator": verify.integrator,
        "stable at": low,
        "unstable at": high,
        "unit": key.unit,
    }
    derived, uncertainty = 0.5 * (low + high), 0.5 * (high - low)
    certificate = certify_number("threshold", key, derived, uncertainty, measured)
    return replace(certificate, remarks=(*limit.remarks, *_remark_integrator(scene, verify), *certificate.remarks))


def _remark_integrator(scene: Scene, verify: ByThreshold) -> tuple[str, ...]:
    """A remark where the model names an integrator and `verify` names none, which is then Euler."""
    own = next(
        (integrator.name for integrator in INTEGRATORS if integrator.code == int(scene.model.opt.integrator)), "Euler"
    )
    if verify.servo is not None or own == "Euler" or "integrator" in verify.model_fields_set:
        return ()
    return (f"The key was derived under Euler, and the model's own integrator is {own}: write verify.integrator.",)


@dataclass(frozen=True)
class _Limit:
    """A bracket [s] with the name of the limit that it holds."""

    bracket_s: tuple[float, float]
    name: str
    remarks: tuple[str, ...] = ()


def _find_limit(scene: Scene, verify: ByThreshold, tolerance_s: float) -> _Limit | str:
    """The limit by the criterion; where a run is too short to decide, the linear stability limit. Or a sentence."""
    if verify.criterion == "no_warning":
        warned = _search_threshold(scene, verify, tolerance_s)
        if warned.bracket_s is not None:
            return _Limit(warned.bracket_s, f"the limit within {verify.seconds:g} s")
        if warned.result is not SearchResult.UNDECIDED:
            return warned.reason
    decays = _find_decay_bracket(scene, verify, tolerance_s)
    if verify.criterion == "decays":
        return decays if isinstance(decays, str) else _Limit(decays, LINEAR)
    short = f"{verify.seconds:g} s are too short to decide by warnings ({warned.reason})"
    if isinstance(decays, str):
        return f"{short}, and the linear stability limit does not decide either: {decays}"
    cure = "write criterion decays, or more seconds"
    return _Limit(decays, LINEAR, (f"{short}: the key is compared with {LINEAR}; {cure}.",))


def _convert_second(key: NumberKey) -> float:
    """One second in the question's unit; 1 for an unknown unit. Raises VerifyError for a unit that is not of time."""
    unit, second = known_unit(key.unit or "s"), known_unit("s")
    assert second is not None
    try:
        return convert(1.0, second, unit) if unit is not None else 1.0
    except Exception as error:
        raise VerifyError("verify", f"{key.unit!r} is not a unit of time: write verify.scale") from error


def _build_scene(verify: ByThreshold, model_xml: ModelXml) -> Scene:
    if verify.servo is not None:
        scene = Scene.from_xml(write_servo_xml(verify.servo)).at(qvel=[1.0])
    else:
        scene = Scene.from_xml(read_xml(verify.model, verify.xml, model_xml))
    if verify.set:
        scene = scene.changed(lambda model: set_fields(model, verify.set, "verify.set"))
    try:
        return scene.at(key=verify.key, qpos=verify.qpos, qvel=verify.qvel)
    except KeyError as error:
        raise VerifyError("verify.key", str(error.args[0])) from error


def write_servo_xml(servo: ServoJoint) -> str:
    """MJCF of a hinge with the inertia and servo gains given, without gravity."""
    i = servo.inertia
    return f"""
    <mujoco><option gravity="0 0 0"/><worldbody><body>
      <inertial pos="0 0 0" mass="1" diaginertia="{i!r} {i!r} {i!r}"/><joint name="hinge" axis="0 1 0"/>
    </body></worldbody>
    <actuator><general joint="hinge" biastype="affine" gainprm="{servo.kp!r}" biasprm="0 {-servo.kp!r} {-servo.kv!r}"/>
    </actuator></mujoco>"""


def _find_decay_bracket(scene: Scene, verify: ByThreshold, tolerance_s: float) -> tuple[float, float] | str:
    """A bracket [s] of the linear stability limit (spectral radius = 1): motion grows at its high end, not at the low.

    Returns a sentence instead if there is no limit in the range, or stepping contradicts it. Below the limit motion
    need not decay: where nothing damps it, it must not grow.
    """
    integrator = BY_NAME[verify.integrator].code
    try:
        limit = find_spectral_limit(scene, low_s=verify.low, high_s=verify.high, integrator=integrator)
    except ValueError as error:
        return str(error)
    if limit is None or limit <= verify.low:
        return f"the spectral radius does not pass 1 between {verify.low:g} and {verify.high:g} s"
    margin = MARGIN * min(tolerance_s, limit)
    low, high = limit - margin, limit + margin
    resting = find_equilibrium_of_motion(scene)
    assert resting is not None, "spectral_limit has found one"
    resting_start = resting.at(qvel=np.full(scene.model.nv, SMALL), act=resting.start.act + SMALL)
    scene = resting_start if _warns_at_once(scene, low, integrator) else scene
    growing = _count_steps(resting, high, integrator)
    steps = max(STEPS_MIN, growing)
    if _grows(scene, low, integrator, steps):
        return f"the spectral radius passes 1 at {limit:.9g} s, but the motion grows at {low:.9g} s"
    # From afar, forces that are not linear may bound the motion: growth is seen from a start near the equilibrium.
    if not (_grows(scene, high, integrator, steps) or _grows(resting_start, high, integrator, growing)):
        return f"the spectral radius passes 1 at {limit:.9g} s, but no motion grows at {high:.9g} s"
    return low, high


def _warns_at_once(scene: Scene, timestep_s: float, integrator: int) -> bool:
    """Whether MuJoCo rejects the start itself, as where it accelerates faster than mjMAXVAL."""
    with scene.borrow(timestep_s=timestep_s, integrator=integrator) as workspace:
        mujoco.mj_step(workspace.model, workspace.data)
        return bool(workspace.counts.any())


def _count_steps(resting: Scene, timestep_s: float, integrator: int) -> int:
    """The steps in which the motion grows clearly, by the spectral radius at the equilibrium."""
    rate = log(max(compute_spectral_radius(resting, timestep_s=timestep_s, integrator=integrator), 1.0))
    return STEPS_MAX if rate == 0 else int(min(max(8, 2 * log(CLEAR) / rate), STEPS_MAX))


def _grows(scene: Scene, timestep_s: float, integrator: int, steps: int) -> bool:
    """Whether the highest speed in the last quarter of the steps exceeds that in the first by the factor GROWN.

    Speed is compared, not position: a motion may come to rest elsewhere, where nothing pulls it back. Raises
    VerifyError if nothing moves.
    """
    fewest, most = READINGS
    gaps = np.random.default_rng(0).integers(max(1, steps // most), max(1, steps // fewest), size=most, endpoint=True)
    gaps = gaps[: int(np.searchsorted(np.cumsum(gaps), steps)) + 1]
    speeds = []
    with scene.borrow(timestep_s=timestep_s, integrator=integrator) as workspace:
        for gap in gaps.tolist():
            speeds.append(float(abs(workspace.data.qvel).max(initial=0.0)))
            mujoco.mj_step(workspace.model, workspace.data, nstep=gap)
            if workspace.counts.any():
                return True
    first, last = max(speeds[: len(speeds) // 4]), max(speeds[-len(speeds) // 4 :])
    if first == 0:
        raise VerifyError("verify", "nothing moves from this start: give a key, qpos or qvel that is not at rest")
    return last > GROWN * first


def _search_threshold(scene: Scene, verify: ByThreshold, tolerance_s: float) -> Threshold:
    """Searches for the timestep above which MuJoCo warns within the horizon."""
    return find_threshold(
        scene,
        low_s=verify.low,
        high_s=verify.high,
        horizon_s=verify.seconds,
        integrator=BY_NAME[verify.integrator].code,
        width_s=MARGIN * tolerance_s,
    )
