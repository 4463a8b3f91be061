"""Compiles a model without visuals: textures, lights, cameras, sites and geoms that no force depends on. No flag of
MuJoCo skips their poses, which take a tenth of a step on the lesson's models."""

import threading
import warnings
from pathlib import Path

import mujoco
import numpy as np

from grader.numerics.needs import Need

IGNORED = ("geom_", "site_", "cam_", "light_", "sensor_", "mesh_", "mat_", "tex_", "name", "bvh_", "oct_")
"""Prefixes of the arrays of MjModel that may differ: the removed elements, with their names and search trees."""

DERIVED = ("body_geom", "body_bvh", "body_con", "body_margin", "dof_length")
"""Prefixes of arrays derived from those, which only collisions and sleep use."""

_quiet = threading.Lock()
"""Python keeps the filters of warnings for all threads."""


def remove_visuals(xml: str, model: mujoco.MjModel, needs: tuple[Need, ...]) -> mujoco.MjModel | None:
    """Compile an MJCF text without visuals; None if nothing can be removed, or the motion would change. `model` is the
    compiled text, and `needs` its needs. Takes about as long as compiling the text."""
    needed = {need.part for need in needs if need.needed}
    if not count_visuals(model) or needed & {"everything", "contacts", "fluid"}:
        return None
    for sites_too in (True, False):
        bare = _strip(xml, sites_too=sites_too)
        if bare is not None and count_visuals(bare) < count_visuals(model) and moves_alike(model, bare):
            return bare
    return None


def compile_untextured(model: str | Path) -> mujoco.MjModel:
    """Compile MJCF text or a file without its textures, which nothing but a picture reads: a sky of dm_control's suite
    takes 50 ms, and each copy of its model 5 ms more. Raises ValueError if it does not compile."""
    spec = mujoco.MjSpec.from_string(model) if isinstance(model, str) else mujoco.MjSpec.from_file(str(model))
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)
    return _compile(spec)


def count_visuals(model: mujoco.MjModel) -> int:
    """Returns the number of geoms, sites, cameras, lights and sensors."""
    return int(model.ngeom + model.nsite + model.ncam + model.nlight + model.nsensor)


def moves_alike(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether all numbers on which the motion may depend are bitwise equal."""
    state = mujoco.mjtState.mjSTATE_INTEGRATION
    if mujoco.mj_stateSize(model, state) != mujoco.mj_stateSize(other, state):
        return False
    for name in dir(model):
        if name.startswith(("_", *IGNORED, *DERIVED)):
            continue
        array = getattr(model, name)
        if isinstance(array, np.ndarray) and array.tobytes() != getattr(other, name).tobytes():
            return False
    return float(model.stat.meaninertia) == float(other.stat.meaninertia)


def _strip(xml: str, *, sites_too: bool) -> mujoco.MjModel | None:
    """Compile the text without visuals; None if a remaining element refers to one, or an included file is missing."""
    try:
        spec = mujoco.MjSpec.from_string(xml)
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
        spec.compiler.discardvisual = True
        for part in [*spec.sensors, *spec.lights, *spec.cameras, *(spec.sites if sites_too else ())]:
            spec.delete(part)
        return _compile(spec)
    except (ValueError, mujoco.FatalError):
        return None


def _compile(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a spec; drops MuJoCo's warnings, such as those of MuJoCo 4.0.0 of deprecated attributes."""
    with _quiet, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return spec.compile()
