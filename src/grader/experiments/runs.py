"""Runs labs and evaluates expressions for measurements; the only module of this room that imports the labs."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np

from grader.domain.lab import LabConfig, Readout
from grader.domain.verify import Setting
from grader.errors import ContentError, GraderError, LabError
from grader.expressions import DATA_RESULTS, DATA_STATE, Machine, compile_program, to_boolean, to_number, to_numbers
from grader.labs import SAME, LabRun, Variant, build_lab_scene, choose_length_s, format_readout, run_lab

__all__ = [
    "DATA_FIELDS",
    "MORE_NUDGED",
    "NUDGED",
    "PROBES",
    "SAME",
    "LabRun",
    "Variant",
    "VerifyError",
    "build_lab_scene",
    "choose_length_s",
    "evaluate",
    "format_readout",
    "list_more_nudged",
    "read_xml",
    "remove_display",
    "run_experiment",
    "set_fields",
    "to_boolean",
    "to_number",
    "to_numbers",
]

DATA_FIELDS = DATA_RESULTS | DATA_STATE
"""Names of the arrays of mjData that expressions may read."""

NUDGE = 1e-10
"""Size of the shifts of positions and velocities of the start [rad, m, and per s] that must not change an answer.

Source: far above rounding, far below any pixel.
"""

NUDGED = (Variant(nudge=NUDGE), Variant(nudge=-NUDGE))

PARTED = 1e-6
"""How far the runs of two nudged starts may part before more are tried: ten thousand times as far as they began."""

MORE_NUDGED = tuple(Variant(nudge=NUDGE, seed=seed) for seed in range(1, 15))
"""Starts that are nudged in other directions, for motions that forget where they began: two of them may agree by
chance, as two tosses of a coin do."""

PROBES = 12
"""Linearisations of the equations of motion along a run."""


UNCOMPUTED = {
    **dict.fromkeys(
        ("data.subtree_linvel", "data.subtree_angmom"), ("mj_subtreeVel", ("subtreelinvel", "subtreeangmom"))
    ),
    **dict.fromkeys(
        ("data.cacc", "data.cfrc_int", "data.cfrc_ext"),
        ("mj_rnePostConstraint", ("accelerometer", "force", "torque", "framelinacc", "frameangacc")),
    ),
    "data.qfrc_inverse": ("mj_inverse", tuple[str, ...]()),
}
"""Fields that mj_step leaves at 0: the function that fills them, and the types of sensors for which MuJoCo calls it.
Source: engine_sensor.c of 3.14.0, mj_sensorVel and mj_sensorAcc."""


class VerifyError(GraderError):
    """A `verify` that cannot be carried out; `key` is the faulty key of the question, such as `verify.expr`."""

    def __init__(self, key: str, why: str) -> None:
        self.key = key
        super().__init__(why)


def read_xml(model: str | None, xml: str | None, model_xml: Callable[[str], str]) -> str:
    """Returns the MJCF that a `verify` names. Raises VerifyError if it names none."""
    if xml is not None:
        return xml
    if model is None:
        raise VerifyError("verify", "verify needs a model or an xml")
    return model_xml(model)


def run_experiment(
    config: LabConfig,
    xml: str,
    controls: Setting | None = None,
    *,
    seconds: float | None,
    variant: Variant = SAME,
    keys: Mapping[str, str],
) -> LabRun:
    """Run a lab. `keys` maps the keys of the lab to those of `verify` from which they were taken.

    Raises VerifyError for an expression or keyframe that cannot be used, LabRefused for control values or lengths
    that are not allowed, ValueError if MuJoCo cannot compile the model.
    """
    texts = (*(readout.expr for readout in config.readouts), config.controller or "", config.setup or "")
    if why := explain_uncomputed(" ".join(texts), lambda: mujoco.MjModel.from_xml_string(xml)):
        raise VerifyError(keys.get("readouts", "verify"), why)
    try:
        run = run_lab(config, xml, controls, (), seconds, variant=variant)
        for error, _ in run.failed.values():  # a page shows a dash, but a key cannot rest on it
            raise error
        return run
    except ContentError as error:
        raise VerifyError(_find_key(error.faults[0].key, keys), error.faults[0].why) from error
    except LabError as error:
        raise VerifyError(_find_key(error.key, keys), error.why) from error
    except KeyError as error:  # no such keyframe
        raise VerifyError(keys.get("key", "verify"), str(error.args[0])) from error


def _find_key(lab_key: str, keys: Mapping[str, str]) -> str:
    """Returns the key of the question for a key of the lab, such as `lab.readouts.0.expr`."""
    part = [*lab_key.split("."), ""][1]
    return keys.get(part, "verify")


def explain_uncomputed(text: str, make_model: Callable[[], mujoco.MjModel]) -> str | None:
    """Says which field of the data that expressions name is always 0 in this model, and what to do."""
    for field, (call, sensors) in UNCOMPUTED.items():
        if call in text or not re.search(rf"{re.escape(field)}\b", text):
            continue
        types = {mujoco.mjtSensor(one).name.removeprefix("mjSENS_").lower() for one in make_model().sensor_type}
        if types.isdisjoint(sensors):
            cure = f"add a sensor, such as {sensors[0]}" if sensors else "data.qfrc_bias has what holds a pose at rest"
            return f"mj_step leaves {field} at 0, which {call} fills: {cure}"
    return None


def list_more_nudged(runs: Sequence[LabRun]) -> tuple[Variant, ...]:
    """Returns the further nudged starts that must be tried after those runs: none where they have not PARTED."""
    one, other = (np.array(run.states) for run in runs)
    if one.shape != other.shape or (one.size and not np.max(np.abs(one - other)) <= PARTED):
        return MORE_NUDGED
    return ()


def remove_display(config: LabConfig, *readouts: str) -> LabConfig:
    """The lab without plots and trail, and with these expressions as its only readouts; it runs as long as before."""
    shown = tuple(Readout(label=text, expr=text) for text in readouts)
    return config.model_copy(update={"readouts": shown, "plots": (), "trail": None, "seconds": choose_length_s(config)})


def evaluate(text: str, model: mujoco.MjModel, data: mujoco.MjData, key: str) -> float:
    """Returns the value of an expression as a number. Raises VerifyError with `key` if it does not compile or fails."""
    with _expression_errors(key):
        if why := explain_uncomputed(text, lambda: model):
            raise VerifyError(key, why)
        return to_number(compile_program(text, "expression", key).run(Machine(model, data)))


def set_fields(model: mujoco.MjModel, fields: Mapping[str, float], key: str) -> None:
    """Set fields by their paths, such as `model.dof_damping[0]`, and recompute the constants that depend on them.

    Raises VerifyError with `key` for a path that does not exist or may not be written.
    """
    data = mujoco.MjData(model)
    machine = Machine(model, data)
    with _expression_errors(key):
        for path, value in fields.items():
            compile_program(f"{path} = value", "statement", key).run(machine, value)
    mujoco.mj_setConst(model, data)


@contextmanager
def _expression_errors(key: str) -> Iterator[None]:
    """Turn errors of an expression into VerifyError."""
    try:
        yield
    except ContentError as error:
        raise VerifyError(key, error.faults[0].why) from error
    except LabError as error:
        raise VerifyError(key, error.why) from error
