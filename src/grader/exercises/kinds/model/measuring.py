"""Compiles a model and measures it. This file is the text of the measuring program, which runs in a process of the jail
of its own: NumPy, MuJoCo and the standard library alone. No code of the student's runs there."""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

READS_FILES = re.compile(r"<\s*(?:include|extension)\b|\bfile\w*\s*=", re.IGNORECASE)
"""Anywhere in the text, in a comment as well: what is a comment is MuJoCo's to say."""
FILE_NAME = re.compile(r"\s*[^\s<>][^<>\n]{0,200}\.(?:xml|mjcf)\s*", re.IGNORECASE)
FILE = "name of a file"
NO_FILES = 'A model that is handed in reads no file: leave out <include>, <extension>, and every file="...".'
IN_COMMENT = "Here a comment has such words: leave them out of it."

SAMPLES = 64
"""Moments of a run at which its expressions are evaluated, beside the first."""
NUMBERS_MAX = 64
"""Most numbers of an expression at one moment."""
NAMES_MAX = 200
NOTHING: Any = None
GEOMS_MAX = 200
WATER = 1000.0
"""The density of a geom that says nothing of its mass [kg/m^3]. Source: mjs_defaultGeom."""
DRAWN_GROUP_MAX = 2
"""Geoms of higher groups are not drawn. Source: the default of mjvOption.geomgroup."""

BAD = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
NAMED = {
    "body": mujoco.mjtObj.mjOBJ_BODY, "joint": mujoco.mjtObj.mjOBJ_JOINT, "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "site": mujoco.mjtObj.mjOBJ_SITE, "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR, "tendon": mujoco.mjtObj.mjOBJ_TENDON,
}  # fmt: skip
"""The elements whose names are told, in the singular as in `model.body("arm")`."""


def measure(inputs: Mapping[str, Any], results: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Submits what is measured of the student's model and of the reference, as JSON."""
    if "returned" in results:
        model = {"returned": bytes(results["returned"]).decode(errors="replace")}
    else:
        model = describe(bytes(results["mjcf"]).decode(errors="replace"), inputs)
    report = {"model": model, "reference": describe(inputs["reference"], inputs)}
    submit("report", np.frombuffer(json.dumps(report).encode(), dtype=np.uint8))


def remove_comments(text: str) -> str:
    """Returns XML without its comments, in linear time: where one has no end, no other has."""
    kept, at = list[str](), 0
    while (begin := text.find("<!--", at)) >= 0 and (end := text.find("-->", begin + 4)) >= 0:
        kept.append(text[at:begin])
        at = end + 3
    return "".join((*kept, text[at:]))


def describe(text: str, inputs: Mapping[str, Any], *, halved: bool = True) -> dict[str, Any]:
    """Returns `error`, why the text cannot be compiled, with the `braces` in it that nothing has filled; `returned`,
    what it is in place of a model; or `goals`, for each goal the values of its expressions, the `names` of the
    elements, the bodies `of_water`, and the `geoms` where the case begins. With `halved` runs are made with half the
    timestep as well."""
    if READS_FILES.search(text):
        is_comment = text.count("<!") == text.count("<!--") and not READS_FILES.search(remove_comments(text))
        return {"error": f"{NO_FILES} {IN_COMMENT}" if is_comment else NO_FILES}
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except (ValueError, mujoco.FatalError) as error:
        if FILE_NAME.fullmatch(text):
            return {"returned": FILE}
        return {"error": str(error)[:400], "braces": find_braces(text, str(error))}
    names = {kind: list_names(model, which) for kind, which in NAMED.items()}
    mujoco.mj_resetCallbacks()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    goals = [dict[str, Any](same={}, half={}, within={}) for _ in inputs["goals"]]
    runs = {"same": inputs["timestep"], "half": inputs["timestep"] / 2} if inputs["seconds"] else {"same": None}
    geoms: list[Any] = []
    for part, timestep_s in runs.items():
        if part == "half" and not halved:
            break
        moments = [*simulate(model, inputs, timestep_s)]
        for goal, measured in zip(inputs["goals"], goals, strict=True):
            for expression in goal["same"]:
                measured[part][expression] = collect(moments, expression)
            for expression in goal["within"] if part == "same" else ():
                measured["within"][expression] = collect(moments, expression)
        geoms = geoms or moments[0].get(GEOMS, [])
    return {"goals": goals, "names": names, "geoms": geoms, "of_water": list_of_water(model)}


def find_braces(text: str, error: str) -> str:
    """Returns which braces stand in the attribute that the compiler cannot read, as `pos of <inertial> has {height} in
    place of a number`; empty for none."""
    named = re.search(r"bad format in attribute '(\w+)'\s+Element '(\w+)'", error)
    if named is None:
        return ""
    found = re.search(
        rf"<{named[2]}\s(?:[^<>]{{0,500}}\s)?{named[1]}\s*=\s*[\"'][^\"'<>{{}}]{{0,200}}(\{{[\w.: +*/()-]{{0,40}}\}})",
        text,
        re.ASCII,
    )
    return f"{named[1]} of <{named[2]}> has {found[1]} in place of a number" if found else ""


GEOMS = "geoms of the first moment"


def simulate(model: mujoco.MjModel, inputs: Mapping[str, Any], timestep_s: float | None) -> Iterator[dict[str, Any]]:
    """Yields the values of all expressions at the moments of a run, the first where the case begins. A run that MuJoCo
    gives up ends early, with the word `lost`."""
    data = mujoco.MjData(model)
    missing = place(model, data, inputs)
    codes = {
        expression: compile(expression, "<goal>", "eval")
        for goal in inputs["goals"]
        for expression in (*goal["same"], *goal["within"])
    }
    if missing:
        yield dict.fromkeys(codes, missing)
        return
    own_s = model.opt.timestep
    model.opt.timestep = timestep_s or own_s
    mujoco.mj_forward(model, data)
    model.opt.timestep = own_s  # an expression may ask for it
    steps = round(inputs["seconds"] / timestep_s) if timestep_s else 0
    every = max(1, steps // SAMPLES)
    yield {GEOMS: list_geoms(model, data), **evaluate_all(model, data, codes)}
    for _ in range(steps // every):
        model.opt.timestep = timestep_s or own_s
        mujoco.mj_step(model, data, nstep=every)
        lost = any(data.warning[kind].number for kind in BAD)
        if not lost:
            mujoco.mj_forward(model, data)
        model.opt.timestep = own_s
        yield {"lost": data.time} if lost else evaluate_all(model, data, codes)
        if lost:
            return


def place(model: mujoco.MjModel, data: mujoco.MjData, inputs: Mapping[str, Any]) -> dict[str, str] | None:
    """Sets the start and the controls of the case; returns what the model lacks for it."""
    try:
        for name, value in inputs["start"].items():
            data.joint(name).qpos[:] = value
        for name, value in inputs["start_velocity"].items():
            data.joint(name).qvel[:] = value
        for name, value in inputs["ctrl"].items():
            data.actuator(name).ctrl[:] = value
    except KeyError:
        return {"missing": name}
    return None


def evaluate_all(model: mujoco.MjModel, data: mujoco.MjData, codes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the value of each expression: a number, a list of numbers, or what the model lacks for it."""
    return {expression: evaluate(model, data, code) for expression, code in codes.items()}


def evaluate(model: mujoco.MjModel, data: mujoco.MjData, code: Any) -> Any:
    """Returns the value of one expression of the author's."""
    names = {
        "model": model, "data": data, "mujoco": mujoco, "np": np,
        "fullinertia": lambda name: compute_full_inertia(model, name),
    }  # fmt: skip
    try:
        value = np.asarray(eval(code, names), dtype=float)  # noqa: S307
    except KeyError as error:
        named = re.search(r"Invalid name '(.*?)'", str(error))
        return {"missing": named[1] if named else str(error)[:100]}
    except Exception as error:
        return {"raised": f"{type(error).__name__}: {error}"[:200]}
    if value.size > NUMBERS_MAX:
        return {"raised": f"more than {NUMBERS_MAX} numbers"}
    return plain(value)


def compute_full_inertia(model: mujoco.MjModel, name: str) -> list[float]:
    """Returns the inertia of a body [kg m^2] about its centre of mass, along the axes of the body, as MJCF's
    `fullinertia` has it: xx, yy, zz, xy, xz, yz. The principal moments are in an order that the compiler chooses."""
    body, turned = model.body(name), np.zeros(9)
    mujoco.mju_quat2Mat(turned, body.iquat)
    frame = turned.reshape(3, 3)
    matrix = frame @ np.diag(body.inertia) @ frame.T
    return [float(matrix[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def plain(value: Any) -> Any:
    """Returns numbers as JSON has them: None for what is not finite."""
    numbers: Any = np.asarray(value, dtype=object)
    return np.where(np.isfinite(value), numbers, NOTHING).tolist()


def collect(moments: list[dict[str, Any]], expression: str) -> dict[str, Any]:
    """Returns the values of an expression at all moments of a run; what is missing, if anything is."""
    lost = next((moment["lost"] for moment in moments if "lost" in moment), None)
    values = [moment[expression] for moment in moments if expression in moment]
    fault = next((value for value in values if isinstance(value, dict)), None)
    return fault or {"values": values, **({} if lost is None else {"lost": lost})}


def list_names(model: mujoco.MjModel, kind: Any) -> list[str]:
    """Returns the names of the elements of a kind, empty for one without."""
    count = {
        mujoco.mjtObj.mjOBJ_BODY: model.nbody, mujoco.mjtObj.mjOBJ_JOINT: model.njnt,
        mujoco.mjtObj.mjOBJ_GEOM: model.ngeom, mujoco.mjtObj.mjOBJ_SITE: model.nsite,
        mujoco.mjtObj.mjOBJ_ACTUATOR: model.nu, mujoco.mjtObj.mjOBJ_SENSOR: model.nsensor,
        mujoco.mjtObj.mjOBJ_TENDON: model.ntendon,
    }[kind]  # fmt: skip
    return [(mujoco.mj_id2name(model, kind, at) or "")[:100] for at in range(min(count, NAMES_MAX))]


def list_of_water(model: mujoco.MjModel) -> list[str]:
    """Returns the names of the bodies that weigh as much as their geoms of MuJoCo's default density."""
    a, b, c = model.geom_size.T
    shape, kinds = model.geom_type, mujoco.mjtGeom
    shapes = {
        kinds.mjGEOM_SPHERE: 4 / 3 * np.pi * a**3, kinds.mjGEOM_CAPSULE: np.pi * a**2 * (2 * b + 4 / 3 * a),
        kinds.mjGEOM_CYLINDER: 2 * np.pi * a**2 * b, kinds.mjGEOM_BOX: 8 * a * b * c,
        kinds.mjGEOM_ELLIPSOID: 4 / 3 * np.pi * a * b * c,
    }  # fmt: skip
    volumes = sum((np.where(shape == int(kind), volume, 0.0) for kind, volume in shapes.items()), np.zeros(len(a)))
    masses = np.bincount(model.geom_bodyid, weights=WATER * volumes, minlength=model.nbody)
    alike = (masses > 0) & (np.abs(masses - model.body_mass) <= 1e-6 * masses)
    return [model.body(int(at)).name[:100] for at in np.flatnonzero(alike)[:NAMES_MAX]]


def list_geoms(model: mujoco.MjModel, data: mujoco.MjData) -> list[dict[str, Any]]:
    """Returns the geoms that are drawn: type, sizes, place and rotation matrix by rows. A mesh is its bounding box."""
    shown = [geom for geom in range(model.ngeom) if model.geom_group[geom] <= DRAWN_GROUP_MAX][:GEOMS_MAX]
    geoms = []
    for at in shown:
        kind = mujoco.mjtGeom(int(model.geom_type[at])).name.removeprefix("mjGEOM_").lower()
        size = model.geom_aabb[at, 3:] if kind in ("mesh", "hfield", "sdf") else model.geom_size[at]
        numbers = np.concatenate([size, data.geom_xpos[at], data.geom_xmat[at]])
        if np.all(np.isfinite(numbers)):
            rounded = np.round(numbers, 5).tolist()
            geoms.append({"type": kind, "size": rounded[:3], "at": rounded[3:6], "turned": rounded[6:]})
    return geoms
