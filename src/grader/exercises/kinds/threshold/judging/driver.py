"""Calls the student's function with a model and an integrator, and submits what it claims. Runs in the jail. The result
`claim` holds the numbers of the claim: none for None, one, or two. For anything else the result `other` holds its text.

The trace has one note, `search`: which runs were made. A run begins at the first mj_step after a data was created or
reset, and ends at the next such moment or with the trial. Only its first step is seen: a call in every step would slow
the script."""

import contextlib
import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any

import mujoco
import numpy as np

note: Callable[..., bool] = globals().get("note", lambda *_: False)
load_model: Callable[[str], Any] = globals().get("load_model", mujoco.MjModel.from_xml_string)
show: Callable[[object], str] = globals().get("show", repr)

RUNS_MAX = 300
"""Runs that are noted in a trial, the first ones."""
RUNS_HIDDEN_MAX = 3
"""The same for a hidden trial, whose numbers stay secret; only its first model is compared."""
MODELS_MAX = 8
"""Different models whose differences from the given one are noted."""
FIELDS = (
    *("actuator_gainprm", "actuator_biasprm", "actuator_gear", "actuator_ctrlrange", "actuator_forcerange"),
    *("body_mass", "body_inertia", "body_ipos", "body_pos"),
    *("dof_damping", "dof_armature", "dof_frictionloss", "jnt_stiffness", "qpos_spring"),
)
OPTIONS = ("gravity", "solver", "disableflags", "enableflags", "iterations", "tolerance", "density", "viscosity")
FLAGS = {name: int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}")) for name in ("actuation", "autoreset")}
"""Flags that are noted by their own names, besides `disableflags`."""
OTHER_STEPS = ("mj_step1", "mj_step2", "mj_Euler", "mj_implicit", "mj_RungeKutta", "mjd_transitionFD")
"""Other functions that step or linearise: each is watched until its first call, and noted in that trial and later."""

plain = {name: getattr(mujoco, name) for name in ("mj_step", "mj_resetData", "mj_resetDataKeyframe")}


class Search:
    """The runs of one trial."""

    def __init__(self) -> None:
        self.others: set[str] = set()
        self.restart(hidden=False)

    def restart(self, *, hidden: bool) -> None:
        """Forgets the runs of the last trial."""
        self.runs_max = RUNS_HIDDEN_MAX if hidden else RUNS_MAX
        self.models_max = 1 if hidden else MODELS_MAX
        self.runs: list[list[float]] = []
        self.total = 0
        self.created = 0
        self.cleared = False
        """Whether the last run was followed by a reset."""
        self.models: list[Any] = []
        self.differs: list[list[str]] = []
        self.given: dict[str, bytes] = {}
        self.waiting = True
        self.open: tuple[Any, Any, list[float]] | None = None
        self.scope: dict[str, Any] = {}
        self.names: list[str] = []
        """By which of its global names, if any, the script itself calls mj_step."""

    def begin(self, model: Any, data: Any) -> None:
        """Notes how a run begins."""
        self.waiting = self.cleared = False
        self.total += 1
        if len(self.runs) == self.runs_max:
            return
        index = next((i for i, known in enumerate(self.models) if known is model), len(self.models))
        if index == len(self.models) and index < self.models_max:
            self.models.append(model)
            self.differs.append(sorted(name for name, value in read_values(model).items() if value != self.given[name]))
        option = model.opt
        start = data.qpos[0] if model.nq else 0.0, data.qvel[0] if model.nv else 0.0
        ctrl = data.ctrl[0] if model.nu else 0.0
        row = [index, option.timestep, option.integrator, data.time, *start, read_warnings(data), ctrl]
        self.open = model, data, [float(value) for value in row]

    def finish(self) -> None:
        """Notes how the last run ended, and waits for the next one."""
        self.waiting = True
        if self.open is None:
            return
        model, data, row = self.open
        self.open = None
        self.runs.append([*row, float(data.time), float(read_warnings(data)), float(model.opt.timestep)])

    def note(self, model: Any) -> None:
        """Adds the note to the trace."""
        given = next((i for i, known in enumerate(self.models) if known is model), None)
        info = {
            "total": self.total,
            "created": self.created,
            "cleared": self.cleared,
            "models": self.differs,
            "given": given,
            "set_s": float(model.opt.timestep),
            "others": sorted(self.others),
        }
        note("search", info, np.array(self.runs).reshape(-1))


def read_values(model: Any) -> dict[str, bytes]:
    """Returns what the motion of a model depends on, but for the timestep and the integrator."""
    values = {name: getattr(model, name).tobytes() for name in FIELDS}
    values |= {name: np.asarray(getattr(model.opt, name)).tobytes() for name in OPTIONS}
    return values | {name: bytes([bool(model.opt.disableflags & bit)]) for name, bit in FLAGS.items()}


def read_warnings(data: Any) -> int:
    """Returns the kinds of warning that have been raised, as the bits of a number."""
    if data.warning.number.tobytes() == CLEAN:
        return 0
    return sum(1 << kind for kind in np.flatnonzero(data.warning.number).tolist())


CLEAN = bytes(4 * int(mujoco.mjtWarning.mjNWARNING))
search = Search()


def before_import() -> None:
    """Watches where runs begin; each function then does what it always does."""
    create = mujoco.MjData.__init__

    def create_data(data: Any, *arguments: Any, **named: Any) -> None:
        end_run()
        create(data, *arguments, **named)

    def watch_reset(name: str) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            end_run()
            search.cleared = search.total > 0
            return plain[name](*arguments, **named)

        return call

    def watch_once(place: Any, name: str) -> None:
        function = getattr(place, name)

        def call(*arguments: Any, **named: Any) -> Any:
            search.others.add(name)
            setattr(place, name, function)
            return function(*arguments, **named)

        setattr(place, name, call)

    mujoco.MjData.__init__ = create_data
    mujoco.mj_step = take_first_step  # for scripts that import the name itself
    for name in ("mj_resetData", "mj_resetDataKeyframe"):
        setattr(mujoco, name, watch_reset(name))
    for name in OTHER_STEPS:
        watch_once(mujoco, name)
    if "mujoco.rollout" in sys.modules:
        watch_once(sys.modules["mujoco.rollout"], "rollout")


def end_run() -> None:
    """Ends the run in progress, and waits for the first step of the next one."""
    search.created += 1
    with contextlib.suppress(Exception):  # a data that the script has broken: the trace ends here
        search.finish()
    set_step(take_first_step)


def set_step(function: Callable[..., Any]) -> None:
    """Puts a function in the place of mj_step, also where the script imported the name itself."""
    mujoco.mj_step = function
    for name in search.names:
        search.scope[name] = function


def take_first_step(*arguments: Any, **named: Any) -> Any:
    """In place of mj_step until a run has begun; a script that keeps it in a local name calls it in every step."""
    if search.waiting:
        with contextlib.suppress(Exception):  # wrong arguments, which mj_step refuses below
            search.begin(arguments[0] if arguments else named["m"], arguments[1] if len(arguments) > 1 else named["d"])
        set_step(plain["mj_step"])
    return plain["mj_step"](*arguments, **named)


def trial(
    functions: Sequence[Callable[..., object]], inputs: Mapping[str, Any], submit: Callable[[str, Any], None]
) -> None:
    """Makes one call on a fresh model, so that no call sees what another changed."""
    (entry,) = functions
    model = load_model(inputs["model"])
    search.restart(hidden=bool(globals().get("hidden")))
    search.given = read_values(model)
    search.scope = getattr(inspect.unwrap(entry), "__globals__", {})
    steps = (take_first_step, plain["mj_step"])
    search.names = [name for name, value in search.scope.items() if any(value is step for step in steps)]
    set_step(take_first_step)
    try:
        claim = entry(model, inputs["integrator"])
    finally:
        with contextlib.suppress(Exception):
            search.finish()
            search.note(model)
    numbers = read_numbers(claim)
    if numbers is None:
        submit("other", np.frombuffer(show(claim)[:200].encode(errors="replace"), dtype=np.uint8))
    else:
        submit("claim", np.array(numbers, dtype=np.float64))


def read_numbers(claim: object) -> list[float] | None:
    """Returns the finite numbers of a claim: none for None, one, or two; None if the claim is anything else. A number
    may be an array of one element."""
    if claim is None:
        return []
    is_many = isinstance(claim, tuple | list) or (isinstance(claim, np.ndarray) and claim.ndim)
    items: list[Any] = list(claim) if is_many else [claim]  # type: ignore[call-overload]
    numbers = [item.item() if isinstance(item, np.ndarray | np.generic) and item.size == 1 else item for item in items]
    return [float(number) for number in numbers] if 1 <= len(numbers) <= 2 and all(map(is_number, numbers)) else None


def is_number(item: object) -> bool:
    """Whether an item is a finite real number that a float can hold; True and False are not."""
    if isinstance(item, bool) or not isinstance(item, Real):
        return False
    try:
        return bool(np.isfinite(float(item)))
    except OverflowError:
        return False
