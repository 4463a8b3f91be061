"""Proves which parts of the engine a compiled model does not need, each with its reason in words. A part is not needed
only if no state, control or applied force that can be set at run time could make it act. Skipping it then leaves
trajectories bitwise the same; the tests check that for all integrators."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import mjtDisableBit, mjtEnableBit

# Never among the flags: AUTORESET, WARMSTART and FILTERPARENT, which change trajectories.
_UNPROVABLE = int(mjtEnableBit.mjENBL_SLEEP | mjtEnableBit.mjENBL_FWDINV | mjtEnableBit.mjENBL_IPC)


@dataclass(frozen=True)
class Need:
    """A part of the engine, whether the model needs it, the reason, and the disable bit that skips it (0: none)."""

    part: str
    needed: bool
    reason: str
    flag: int = 0


def prove_needs(model: mujoco.MjModel) -> tuple[Need, ...]:
    """Returns all needs of `model`, in a fixed order."""
    if model.nplugin:
        return (Need("everything", True, "the model has plug-ins, which may read or change anything"),)
    if int(model.opt.enableflags) & _UNPROVABLE:
        return (Need("everything", True, "sleep, forward-inverse comparison or IPC is enabled"),)
    parts = [_prove_equality(model), _prove_friction_loss(model), _prove_limits(model), _prove_contacts(model)]
    parts.append(_combine("constraints", parts, mjtDisableBit.mjDSBL_CONSTRAINT))
    parts.append(_prove_islands(parts[-1]))
    passive = [_prove_springs(model), _prove_dampers(model), _prove_gravity_compensation(model), _prove_fluid(model)]
    # MuJoCo skips the whole stage only if springs and dampers are both disabled.
    springs_and_dampers = mjtDisableBit.mjDSBL_SPRING | mjtDisableBit.mjDSBL_DAMPER
    parts += [*passive, _combine("passive forces", passive, springs_and_dampers)]
    parts += [_prove_gravity(model), _prove_actuation(model), _prove_sensors(model), _count_shown(model)]
    return tuple(parts)


def list_skippable_flags(needs: tuple[Need, ...], *, sensors_read: bool = False) -> int:
    """Returns the disable bits of all parts that are not needed; sensors are not skipped if `sensors_read`."""
    bits = 0
    for need in needs:
        if (need.part == "sensors" and not sensors_read) or not need.needed:
            bits |= need.flag
    return bits


def assert_proved(needs: tuple[Need, ...], data: mujoco.MjData) -> None:
    """Check the proofs against the final `data` of a run that skipped nothing; a failure is a bug of this module."""
    counts: dict[str, Callable[[], int]] = {
        "equality constraints": lambda: int(data.ne),
        "friction loss": lambda: int(data.nf),
        "contacts": lambda: int(data.ncon),
        "constraints": lambda: int(data.nefc),
    }
    for need in needs:
        if not need.needed and need.part in counts:
            assert counts[need.part]() == 0, f"{need.part} appeared although {need.reason}"


def _prove_equality(model: mujoco.MjModel) -> Need:
    reason = f"{model.neq} equality constraints" if model.neq else "no equality constraint is defined"
    return Need("equality constraints", model.neq > 0, reason, int(mjtDisableBit.mjDSBL_EQUALITY))


def _prove_friction_loss(model: mujoco.MjModel) -> Need:
    needed = bool(np.any(model.dof_frictionloss != 0) or np.any(model.tendon_frictionloss != 0))
    reason = "a joint or tendon has friction loss" if needed else "frictionloss is zero on all joints and tendons"
    return Need("friction loss", needed, reason, int(mjtDisableBit.mjDSBL_FRICTIONLOSS))


def _prove_limits(model: mujoco.MjModel) -> Need:
    needed = bool(np.any(model.jnt_limited) or np.any(model.tendon_limited))
    reason = "a joint or tendon is limited" if needed else "no joint or tendon is limited"
    return Need("limits", needed, reason, int(mjtDisableBit.mjDSBL_LIMIT))


def _prove_contacts(model: mujoco.MjModel) -> Need:
    reason = next(_find_collisions(model), None)
    words = reason or "no two geoms of bodies that move against each other may collide"
    return Need("contacts", reason is not None, words, int(mjtDisableBit.mjDSBL_CONTACT))


def _find_collisions(model: mujoco.MjModel) -> Iterator[str]:
    """Reasons why two geoms may touch, by the filters of MuJoCo's collision driver."""
    if model.nflex:
        yield "flexible bodies may collide"
    if model.npair:
        yield f"{model.npair} explicit contact pairs"
    excluded = {int(signature) for signature in model.exclude_signature}
    types, affinities, welds = model.geom_contype, model.geom_conaffinity, model.body_weldid[model.geom_bodyid]
    for first in np.flatnonzero(types | affinities).tolist():
        later = slice(first + 1, None)
        matched = (types[first] & affinities[later]) | (types[later] & affinities[first])
        for second in (np.flatnonzero((matched != 0) & (welds[later] != welds[first])) + first + 1).tolist():
            body1, body2 = sorted((int(model.geom_bodyid[first]), int(model.geom_bodyid[second])))
            if not _is_filtered(model, body1, body2, excluded):
                yield f"geoms {first} and {second} may collide"


def _is_filtered(model: mujoco.MjModel, body1: int, body2: int, excluded: set[int]) -> bool:
    """Whether MuJoCo skips a pair of bodies that move against each other: an excluded pair, or parent and child."""
    weld1, weld2 = int(model.body_weldid[body1]), int(model.body_weldid[body2])
    if (body1 << 16) + body2 in excluded:
        return True
    if int(model.opt.disableflags) & mjtDisableBit.mjDSBL_FILTERPARENT or 0 in (weld1, weld2):
        return False
    parent1 = int(model.body_weldid[model.body_parentid[weld1]])
    parent2 = int(model.body_weldid[model.body_parentid[weld2]])
    return parent2 == weld1 or parent1 == weld2


def _prove_islands(constraints: Need) -> Need:
    """Needed even for a single island: its own solver may stop after another number of iterations."""
    needed = constraints.needed
    reason = "there are constraints, which are solved by island" if needed else "there are no constraints to split"
    return Need("islands", needed, reason, int(mjtDisableBit.mjDSBL_ISLAND))


def _prove_springs(model: mujoco.MjModel) -> Need:
    arrays = (model.jnt_stiffness, model.jnt_stiffnesspoly, model.tendon_stiffness, model.tendon_stiffnesspoly)
    needed = model.nflex > 0 or any(np.any(values != 0) for values in arrays)
    reason = "a joint, tendon or flex has stiffness" if needed else "no joint or tendon has stiffness"
    return Need("springs", needed, reason)


def _prove_dampers(model: mujoco.MjModel) -> Need:
    arrays = (
        *(model.dof_damping, model.dof_dampingpoly, model.tendon_damping, model.tendon_dampingpoly),
        *(model.actuator_damping, model.actuator_dampingpoly),
    )
    needed = model.nflex > 0 or any(np.any(values != 0) for values in arrays)
    reason = "a joint, tendon, actuator or flex has damping" if needed else "no joint, tendon or actuator has damping"
    return Need("dampers", needed, reason)


def _prove_gravity_compensation(model: mujoco.MjModel) -> Need:
    needed = model.ngravcomp > 0 or bool(np.any(model.body_gravcomp != 0))
    return Need("gravity compensation", needed, "a body is compensated" if needed else "no body is compensated")


def _prove_fluid(model: mujoco.MjModel) -> Need:
    needed = model.opt.density != 0 or model.opt.viscosity != 0
    return Need("fluid", bool(needed), "there is a medium" if needed else "density and viscosity are zero")


def _combine(whole: str, parts: list[Need], flag: int) -> Need:
    wanted = [part.part for part in parts if part.needed]
    reason = "there are " + ", ".join(wanted) if wanted else "none of " + ", ".join(part.part for part in parts)
    return Need(whole, bool(wanted), reason, int(flag))


def _prove_gravity(model: mujoco.MjModel) -> Need:
    needed = bool(np.any(model.opt.gravity != 0))
    return Need("gravity", needed, "gravity acts" if needed else "gravity is zero")


def _prove_actuation(model: mujoco.MjModel) -> Need:
    reason = f"{model.nu} actuator{'s' if model.nu > 1 else ''}" if model.nu else "there are no actuators"
    return Need("actuation", model.nu > 0, reason, int(mjtDisableBit.mjDSBL_ACTUATION))


def _prove_sensors(model: mujoco.MjModel) -> Need:
    """Sensors do not affect the motion, but with a history they are part of the state."""
    if model.nhistory:
        return Need("sensors", True, "sensors or controls keep a history")
    reason = f"{model.nsensor} sensors, needed only where they are read" if model.nsensor else "there are no sensors"
    return Need("sensors", model.nsensor > 0, reason, int(mjtDisableBit.mjDSBL_SENSOR))


def _count_shown(model: mujoco.MjModel) -> Need:
    """No flag of MuJoCo skips their poses; `visuals.remove_visuals` compiles a model without them."""
    shown = int(np.count_nonzero((model.geom_contype == 0) & (model.geom_conaffinity == 0)))
    return Need("visuals", False, f"{shown} geoms, {model.ncam} cameras and {model.nlight} lights only show")
