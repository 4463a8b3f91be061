"""Fourth-order Runge-Kutta over mj_forward: the installed MuJoCo's scheme, and one of fourth order on rotations too.

Both read accelerations and activation rates from `forward(model, data)`, by default `mujoco.mj_forward`; a caller may
pass another function, for instance one that adds a force. Models with plug-ins, sleep, histories or activation
dynamics that MuJoCo does not integrate by a plain Euler or exact-filter update are refused with ValueError.
"""

from collections.abc import Callable
from math import exp, isfinite, nan, pi, remainder, sqrt, tan

import mujoco
import numpy as np
from mujoco import mjtDisableBit, mjtDyn, mjtEnableBit, mjtJoint

from grader.numerics.scene import Vector
from grader.numerics.version import RK4_ORDER_ON_ROTATIONS

Forward = Callable[[mujoco.MjModel, mujoco.MjData], object]

STAGES = (0.5, 0.5, 1.0)
"""Fractions of the step at which stages 2, 3 and 4 are evaluated, each along the slope of the previous stage."""

WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
"""Source: Kutta's classical method, the tableau of MuJoCo's integrator RK4."""

PLAIN_DYNAMICS = tuple(
    int(getattr(mjtDyn, f"mjDYN_{name}")) for name in ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT", "MUSCLE")
)


def step_mujoco_rk4(model: mujoco.MjModel, data: mujoco.MjData, forward: Forward = mujoco.mj_forward) -> None:
    """Advance `data` by `model.opt.timestep` as mj_step with integrator RK4 does.

    Positions of free and ball joints advance by one mj_integratePos along the summed velocities of the stages. MuJoCo
    4.0.0 corrects these velocities as `step_lie_rk4` does, and is of fourth order there; 3.14.0 does not, and is of
    second order. Bit for bit the same, but for that correction, which agrees to rounding error. Warm start, activations
    and time advance as in MuJoCo; its divergence checks are not made.
    """
    check_supported(model)
    corrected = find_rotation_slices(model) if RK4_ORDER_ON_ROTATIONS == 4 else ()
    h, start, nv = float(model.opt.timestep), float(data.time), int(model.nv)
    qpos, rest = data.qpos.copy(), _read_rest(data)
    forward(model, data)
    slopes = [_read_slope(data)]
    for fraction in STAGES:
        slope = fraction * slopes[-1]
        data.qpos[:] = qpos
        mujoco.mj_integratePos(model, data.qpos, slope[:nv], h)
        _set_rest(data, _add_scaled(rest, slope[nv:], h))
        data.time = start + fraction * h
        forward(model, data)
        slopes.append(_read_slope(data))
        _move_to_chart(corrected, h * slope, slopes[-1])
    slope = np.zeros(slopes[0].size)
    for weight, part in zip(WEIGHTS, slopes, strict=True):
        mujoco.mju_addToScl(slope, part, weight)
    data.qpos[:] = qpos
    _set_rest(data, rest)
    if data.act.size:
        _advance_act(model, data, slope[2 * nv :])
    mujoco.mju_addToScl(data.qvel, slope[nv : 2 * nv], h)
    mujoco.mj_integratePos(model, data.qpos, slope[:nv], h)
    data.time = start + h
    data.qacc_warmstart[:] = data.qacc


def step_lie_rk4(model: mujoco.MjModel, data: mujoco.MjData, forward: Forward = mujoco.mj_forward) -> None:
    """Advance `data` by `model.opt.timestep` with fourth order, rotations included.

    The classical method in exponential coordinates u around the step's start, qpos = qpos0 (+) u, where the rotation
    vector of a ball or free joint obeys Bortz' equation. Source: Munthe-Kaas 1999, doi 10.1016/S0168-9274(98)00030-0.
    Exact filters advance by the same rule as other activations, unlike in MuJoCo.
    """
    check_supported(model)
    h, start, nv = float(model.opt.timestep), float(data.time), int(model.nv)
    qpos, rest = data.qpos.copy(), _read_rest(data)
    rotations = find_rotation_slices(model)
    slopes: list[Vector] = []
    shift = np.zeros(nv + rest.size)
    for fraction in (0.0, *STAGES):
        if slopes:
            shift = fraction * h * slopes[-1]
            _set_rest(data, rest + shift[nv:])
            data.qpos[:] = qpos
            mujoco.mj_integratePos(model, data.qpos, shift[:nv], 1.0)
            data.time = start + fraction * h
        forward(model, data)
        slopes.append(_read_slope(data))
        _move_to_chart(rotations, shift, slopes[-1])
    shift = h * np.dot(WEIGHTS, slopes)
    data.qpos[:] = qpos
    _set_rest(data, rest + shift[nv:])
    data.act[:] = _clamp(model, data.act)
    mujoco.mj_integratePos(model, data.qpos, shift[:nv], 1.0)
    data.time = start + h
    data.qacc_warmstart[:] = data.qacc


def check_supported(model: mujoco.MjModel) -> None:
    """Raise ValueError for a model with states that this module does not advance."""
    if model.nplugin or model.nhistory:
        raise ValueError("a model with plug-ins or histories is not supported")
    if int(model.opt.enableflags) & mjtEnableBit.mjENBL_SLEEP:
        raise ValueError("a model whose bodies may sleep is not supported")
    if any(int(kind) not in PLAIN_DYNAMICS for kind in model.actuator_dyntype):
        raise ValueError("activation dynamics beyond integrator, filter, exact filter and muscle are not supported")


def find_rotation_slices(model: mujoco.MjModel) -> tuple[slice, ...]:
    """Returns the slices of qvel with the angular velocities of ball and free joints."""
    offsets = {int(mjtJoint.mjJNT_BALL): 0, int(mjtJoint.mjJNT_FREE): 3}
    joints = zip(model.jnt_dofadr.tolist(), model.jnt_type.tolist(), strict=True)
    starts = [address + offsets[kind] for address, kind in joints if kind in offsets]
    return tuple(slice(start, start + 3) for start in starts)


def _read_slope(data: mujoco.MjData) -> Vector:
    """Velocities, accelerations and activation rates, (2 nv + na,)."""
    return np.concatenate((data.qvel, data.qacc, data.act_dot))


def _read_rest(data: mujoco.MjData) -> Vector:
    """Return the state without the positions: velocities and activations, (nv + na,)."""
    return np.concatenate((data.qvel, data.act))


def _set_rest(data: mujoco.MjData, rest: Vector) -> None:
    nv = data.qvel.size
    data.qvel[:] = rest[:nv]
    if data.act.size:
        data.act[:] = rest[nv:]


def _add_scaled(total: Vector, part: Vector, scale: float) -> Vector:
    """Return total + part * scale, computed by MuJoCo's own routine for the same rounding."""
    result = total.copy()
    mujoco.mju_addToScl(result, part, scale)
    return result


def _advance_act(model: mujoco.MjModel, data: mujoco.MjData, rate: Vector) -> None:
    """Update activations as MuJoCo does: exact for exact filters, else explicit Euler, then clamped."""
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
    data.act[:] = _clamp(model, data.act)


def _clamp(model: mujoco.MjModel, act: Vector) -> Vector:
    clamped = act.copy()
    for actuator in np.flatnonzero(model.actuator_actlimited):
        address = int(model.actuator_actadr[actuator])
        clamped[address] = np.clip(act[address], *model.actuator_actrange[actuator])
    return clamped


def _move_to_chart(rotations: tuple[slice, ...], chart: Vector, slope: Vector) -> None:
    """Bortz' equation, in place: u' = w + u x w / 2 + b(|u|) u x (u x w), with the velocity w in the body's frame. A
    rotation vector u of more than half a turn is replaced by the shorter one of the same rotation."""
    for where in rotations:
        ux, uy, uz = _shorten(*chart[where].tolist())
        wx, wy, wz = slope[where].tolist()
        cx, cy, cz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        b = _compute_bortz(sqrt(ux * ux + uy * uy + uz * uz))
        slope[where] = (
            wx + 0.5 * cx + b * (uy * cz - uz * cy),
            wy + 0.5 * cy + b * (uz * cx - ux * cz),
            wz + 0.5 * cz + b * (ux * cy - uy * cx),
        )


def _shorten(ux: float, uy: float, uz: float) -> tuple[float, float, float]:
    """Returns the rotation vector of at most half a turn [rad]; nan for one that is not finite."""
    angle = sqrt(ux * ux + uy * uy + uz * uz)
    if angle <= pi:
        return ux, uy, uz
    scale = remainder(angle, 2 * pi) / angle if isfinite(angle) else nan
    return scale * ux, scale * uy, scale * uz


def _compute_bortz(angle: float) -> float:
    """Return (1 - (a/2) cot(a/2)) / a^2; for small angles by its series, as the closed form cancels."""
    if angle < 1e-2:
        return 1 / 12 + angle**2 / 720 + angle**4 / 30240
    half = 0.5 * angle
    return (1 - half / tan(half)) / angle**2
