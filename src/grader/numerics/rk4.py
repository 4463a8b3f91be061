"""Fourth-order Runge-Kutta over mj_forward: MuJoCo 3.14.0's own scheme, and one that is of fourth order on rotations.

Both read acceleration and activation rates from `forward(model, data)`, by default `mujoco.mj_forward`; a caller may
pass another one, for instance with one more force in it. Models with plug-ins, sleep, histories or activation
dynamics that MuJoCo does not integrate by a plain Euler or exact-filter update are refused with ValueError.
"""

from collections.abc import Callable
from math import exp

import mujoco
import numpy as np
from mujoco import mjtDisableBit, mjtDyn, mjtEnableBit, mjtJoint

from grader.numerics.scene import Vector

Forward = Callable[[mujoco.MjModel, mujoco.MjData], object]

STAGES = (0.5, 0.5, 1.0)
"""Fractions of the step at which stages 2, 3 and 4 stand, each from the slope of the stage before."""

WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
"""Source: Kutta's classical method, the tableau of MuJoCo's integrator RK4."""

PLAIN_DYNAMICS = (
    int(mjtDyn.mjDYN_NONE),
    int(mjtDyn.mjDYN_INTEGRATOR),
    int(mjtDyn.mjDYN_FILTER),
    int(mjtDyn.mjDYN_FILTEREXACT),
    int(mjtDyn.mjDYN_MUSCLE),
)


def mujoco_rk4_step(model: mujoco.MjModel, data: mujoco.MjData, forward: Forward = mujoco.mj_forward) -> None:
    """Advance `data` by `model.opt.timestep` as mj_step with integrator RK4 does, bit for bit.

    Positions of free and ball joints advance by one mj_integratePos along the summed velocities, which is of second
    order there. Warm start, activations and time are carried as MuJoCo carries them; its divergence checks are not.
    """
    check_supported(model)
    h, start = float(model.opt.timestep), float(data.time)
    qpos, qvel, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    forward(model, data)
    slopes = [_slope(data)]
    for fraction in STAGES:
        velocity, acceleration, rate = (fraction * part for part in slopes[-1])
        data.qpos[:], data.qvel[:], data.act[:] = qpos, qvel, act
        mujoco.mj_integratePos(model, data.qpos, velocity, h)
        mujoco.mju_addToScl(data.qvel, acceleration, h)
        _add(data.act, rate, h)
        data.time = start + fraction * h
        forward(model, data)
        slopes.append(_slope(data))
    velocity, acceleration, rate = (_weighted(parts) for parts in zip(*slopes, strict=True))
    data.qpos[:], data.qvel[:], data.act[:] = qpos, qvel, act
    _advance_act(model, data, rate)
    _add(data.qvel, acceleration, h)
    mujoco.mj_integratePos(model, data.qpos, velocity, h)
    data.time = start + h
    data.qacc_warmstart[:] = data.qacc


def lie_rk4_step(model: mujoco.MjModel, data: mujoco.MjData, forward: Forward = mujoco.mj_forward) -> None:
    """Advance `data` by `model.opt.timestep` with true fourth order, rotations included.

    The classical method in exponential coordinates u around the step's start, qpos = qpos0 (+) u, where the rotation
    vector of a ball or free joint obeys Bortz' equation. Source: Munthe-Kaas 1999, doi 10.1016/S0168-9274(98)00030-0.
    Activations advance by the plain rule also where MuJoCo filters exactly.
    """
    check_supported(model)
    h, start = float(model.opt.timestep), float(data.time)
    qpos, qvel, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    rotations = rotation_slices(model)
    chart = np.zeros(model.nv)
    slopes: list[tuple[Vector, Vector, Vector]] = []
    for fraction in (0.0, *STAGES):
        if slopes:
            shift, acceleration, rate = (fraction * h * part for part in slopes[-1])
            chart, data.qvel[:], data.act[:] = shift, qvel + acceleration, act + rate
        data.qpos[:] = qpos
        mujoco.mj_integratePos(model, data.qpos, chart, 1.0)
        data.time = start + fraction * h
        forward(model, data)
        velocity, acceleration, rate = _slope(data)
        slopes.append((_chart_rate(rotations, chart, velocity), acceleration, rate))
    shift, acceleration, rate = (h * _weighted(parts) for parts in zip(*slopes, strict=True))
    data.qpos[:], data.qvel[:], data.act[:] = qpos, qvel + acceleration, _clamped(model, act + rate)
    mujoco.mj_integratePos(model, data.qpos, shift, 1.0)
    data.time = start + h
    data.qacc_warmstart[:] = data.qacc


def check_supported(model: mujoco.MjModel) -> None:
    """ValueError where MuJoCo would advance more than this module knows of."""
    if model.nplugin or model.nhistory:
        raise ValueError("a model with plug-ins or histories is not supported")
    if int(model.opt.enableflags) & mjtEnableBit.mjENBL_SLEEP:
        raise ValueError("a model whose bodies may sleep is not supported")
    if any(int(kind) not in PLAIN_DYNAMICS for kind in model.actuator_dyntype):
        raise ValueError("activation dynamics beyond integrator, filter, exact filter and muscle are not supported")


def rotation_slices(model: mujoco.MjModel) -> tuple[slice, ...]:
    """Where the angular velocities of ball and free joints stand in qvel."""
    offsets = {int(mjtJoint.mjJNT_BALL): 0, int(mjtJoint.mjJNT_FREE): 3}
    starts = [
        int(adr) + offsets[int(kind)]
        for adr, kind in zip(model.jnt_dofadr, model.jnt_type, strict=True)
        if int(kind) in offsets
    ]
    return tuple(slice(start, start + 3) for start in starts)


def _slope(data: mujoco.MjData) -> tuple[Vector, Vector, Vector]:
    return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()


def _weighted(parts: tuple[Vector, ...]) -> Vector:
    """The sum of WEIGHTS times parts, in MuJoCo's order of operations."""
    total = np.zeros_like(parts[0])
    for weight, part in zip(WEIGHTS, parts, strict=True):
        _add(total, part, weight)
    return total


def _add(total: Vector, part: Vector, scale: float) -> None:
    """total += part * scale by MuJoCo's own routine, so that both round alike on every machine."""
    if total.size:
        mujoco.mju_addToScl(total, part, scale)


def _advance_act(model: mujoco.MjModel, data: mujoco.MjData, rate: Vector) -> None:
    """MuJoCo's update of activations: exact for exact filters, plain otherwise, then clamped; none if disabled."""
    if int(model.opt.disableflags) & mjtDisableBit.mjDSBL_ACTUATION:
        return
    h = float(model.opt.timestep)
    for actuator in range(model.nu):
        address = int(model.actuator_actadr[actuator])
        if address < 0:
            continue
        step = h
        if int(model.actuator_dyntype[actuator]) == mjtDyn.mjDYN_FILTEREXACT:
            tau = max(mujoco.mjMINVAL, float(model.actuator_dynprm[actuator, 0]))
            step = tau * (1 - exp(-h / tau))
        data.act[address] += rate[address] * step
    data.act[:] = _clamped(model, data.act)


def _clamped(model: mujoco.MjModel, act: Vector) -> Vector:
    clamped = act.copy()
    for actuator in np.flatnonzero(model.actuator_actlimited):
        address = int(model.actuator_actadr[actuator])
        clamped[address] = np.clip(act[address], *model.actuator_actrange[actuator])
    return clamped


def _chart_rate(rotations: tuple[slice, ...], chart: Vector, velocity: Vector) -> Vector:
    """Bortz' equation: u' = w + u x w / 2 + b(|u|) u x (u x w), with the velocity w in the body's frame."""
    rate = velocity.copy()
    for where in rotations:
        turn, spin = chart[where], velocity[where]
        cross, twice = np.empty(3), np.empty(3)
        mujoco.mju_cross(cross, turn, spin)
        mujoco.mju_cross(twice, turn, cross)
        rate[where] = spin + 0.5 * cross + _bortz(float(np.linalg.norm(turn))) * twice
    return rate


def _bortz(angle: float) -> float:
    """(1 - (a/2) cot(a/2)) / a^2, by its series where that cancels."""
    if angle < 1e-2:
        return 1 / 12 + angle**2 / 720 + angle**4 / 30240
    half = 0.5 * angle
    return float((1 - half / np.tan(half)) / angle**2)
