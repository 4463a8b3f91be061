"""A model without what only shows: lights, cameras, sites and geoms that no force depends on.

No flag of MuJoCo leaves their poses out; on the lesson's models they are a tenth of a step.
"""

import mujoco
import numpy as np

from grader.numerics.needs import Need

SHOWN = ("geom_", "site_", "cam_", "light_", "sensor_", "mesh_", "mat_", "tex_", "name", "bvh_", "oct_")
"""Beginnings of the names of MjModel's arrays that may differ: what is left out, with its names and search trees."""

DERIVED = ("body_geom", "body_bvh", "body_con", "body_margin", "dof_length")
"""And of those that are derived from it, for collisions and sleep only."""


def without_visuals(xml: str, model: mujoco.MjModel, needs: tuple[Need, ...]) -> mujoco.MjModel | None:
    """The model of an MJCF text with less to draw, or None where nothing could go or a number of the motion changed.

    `model` is the whole one, and `needs` what is proved of it. It costs about as much as compiling the text.
    """
    needed = {need.part for need in needs if need.needed}
    if not shown(model) or needed & {"everything", "contacts", "fluid"}:
        return None
    for sites_too in (True, False):
        bare = _stripped(xml, sites_too=sites_too)
        if bare is not None and shown(bare) < shown(model) and moves_alike(model, bare):
            return bare
    return None


def shown(model: mujoco.MjModel) -> int:
    """How many things a model has that might only show, or only be read."""
    return int(model.ngeom + model.nsite + model.ncam + model.nlight + model.nsensor)


def moves_alike(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Are all numbers the same, bit for bit, that the motion may depend on?"""
    state = mujoco.mjtState.mjSTATE_INTEGRATION
    if mujoco.mj_stateSize(model, state) != mujoco.mj_stateSize(other, state):
        return False
    for name in dir(model):
        if name.startswith(("_", *SHOWN, *DERIVED)):
            continue
        one = getattr(model, name)
        if isinstance(one, np.ndarray) and one.tobytes() != getattr(other, name).tobytes():
            return False
    return float(model.stat.meaninertia) == float(other.stat.meaninertia)


def _stripped(xml: str, *, sites_too: bool) -> mujoco.MjModel | None:
    """Without them; None where something that stays refers to one, or a file that the text includes is gone."""
    try:
        spec = mujoco.MjSpec.from_string(xml)
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
        spec.compiler.discardvisual = True
        for part in [*spec.sensors, *spec.lights, *spec.cameras, *(spec.sites if sites_too else ())]:
            spec.delete(part)
        return spec.compile()
    except (ValueError, mujoco.FatalError):
        return None
