"""Where a model's quaternions are."""

from dataclasses import dataclass

import mujoco

OFFSETS = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
"""Where quaternion and angular velocity begin in a joint's coordinates."""


@dataclass(frozen=True)
class QuaternionAddress:
    """The addresses of one quaternion in qpos, and of its angular velocity in qvel."""

    qpos: int
    dof: int


def find_quaternions(model: mujoco.MjModel) -> list[QuaternionAddress]:
    """Returns the addresses of the model's quaternions."""
    return [
        QuaternionAddress(at + OFFSETS[kind], dof + OFFSETS[kind])
        for kind, at, dof in list_joints(model)
        if kind in OFFSETS
    ]


def list_joints(model: mujoco.MjModel) -> list[tuple[int, int, int]]:
    """Returns type, address in qpos and address in qvel of every joint."""
    return list(zip(model.jnt_type.tolist(), model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist(), strict=True))
