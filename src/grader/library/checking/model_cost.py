"""Decides what a model costs before this process compiles it: by its text, else in a process with limits."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from functools import lru_cache

ELEMENTS_MAX = 5000
"""Most elements of a model, each as often as it is replicated."""

UNBOUNDED = {
    "replicate", "composite", "flexcomp", "flex", "skin", "plugin", "size", "lengthrange", "muscle", "model",
    "hfield", "mesh", "texture",
}  # fmt: skip
SIZING = {"actdim", "dim", "nsample", "num"}
"""Elements and attributes that make a model larger, or slower to compile, than its text shows; so do muscles."""

CPU_S_MAX, MEMORY_MB_MAX, WALL_S_MAX = 5, 1024, 300
"""Limits of the process that compiles such a model, makes its data, and computes one step."""

PROGRAM = f"""
import json, resource, sys
resource.setrlimit(resource.RLIMIT_CPU, ({CPU_S_MAX}, {CPU_S_MAX}))
resource.setrlimit(resource.RLIMIT_AS, ({MEMORY_MB_MAX} << 20, {MEMORY_MB_MAX} << 20))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
import mujoco
print("ready", flush=True)
xml, attached = json.load(sys.stdin)
try:
    spec = mujoco.MjSpec.from_string(xml, include={{name: text.encode() for name, text in attached.items()}})
    model = spec.compile()
except ValueError as error:
    sys.exit("allocate" in str(error))
if model.nbody + model.ngeom + model.nsite > {ELEMENTS_MAX}:
    sys.exit(1)
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
"""
"""What the process runs. A model that does not compile is reported where it is compiled again."""

CURE = "make it smaller: fewer copies, coarser meshes, height fields and textures"


def explain_cost(xml: str, attached: Mapping[str, str] = {}) -> str | None:
    """Returns why a model costs too much to be served, with the cure, or None. `attached` are the texts of the models
    that it attaches, by the file names that it uses. A text that is not XML costs nothing."""
    return _explain(xml, tuple(sorted(attached.items())))


@lru_cache(maxsize=1024)
def _explain(xml: str, attached: tuple[tuple[str, str], ...]) -> str | None:
    total, is_bounded = 0, not attached
    for text in (xml, *(text for _, text in attached)):
        try:
            root = ET.fromstring(text)  # noqa: S314 - the author's own file
        except ET.ParseError:
            return None
        total += count_elements(root)
        is_bounded = is_bounded and all(map(is_as_written, root.iter()))
    if total > ELEMENTS_MAX:
        return f"has {total} elements, and at most {ELEMENTS_MAX} are allowed: {CURE}"
    return None if is_bounded else _explain_run(json.dumps([xml, dict(attached)]))


def is_as_written(element: ET.Element) -> bool:
    """Says whether an element makes a model no larger than its text shows."""
    return not (element.tag in UNBOUNDED or SIZING & element.attrib.keys() or "muscle" in element.attrib.values())


def count_elements(root: ET.Element) -> int:
    """Returns the number of elements, each as often as `replicate` writes it."""
    total, waiting = 0, [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        total += times
        copies = element.get("count", "").strip() if element.tag == "replicate" else ""
        times *= int(copies) if copies.isdecimal() and len(copies) < 20 else 1
        waiting += [(inner, times) for inner in element]
    return total


def _explain_run(job: str) -> str | None:
    """Compiles a model in a process with limits; returns what stopped it, or None. Raises RuntimeError where the
    process itself cannot work here."""
    command = [sys.executable, "-I", "-c", PROGRAM]
    environment = {"OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "disable"}
    try:
        ended = subprocess.run(  # noqa: S603 - our own program
            command, input=job, capture_output=True, text=True, timeout=WALL_S_MAX, env=environment, check=False
        )
    except subprocess.TimeoutExpired:
        return f"is not compiled within {WALL_S_MAX} s: {CURE}"
    if "ready" not in ended.stdout:
        raise RuntimeError(f"the process that compiles models did not start: {ended.stderr[-500:]}")
    if ended.returncode == 0:
        return None
    limits = f"{CPU_S_MAX} s of computing, {MEMORY_MB_MAX} MB of memory and {ELEMENTS_MAX} bodies, geoms and sites"
    return f"cannot be compiled and stepped once within {limits}: {CURE}"
