"""Scene: a model, its initial state, its named quantities, and what it does not need.

Thread safety: a Scene is immutable and may be shared. Its model is never stepped or written. Each run borrows a
workspace (a copy of the model and an MjData), which no other run uses at the same time, and returns it. Threads and
nested runs therefore never share an MjData or a mutable MjModel, while a single thread reuses one workspace.
"""

import copy
import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import isfinite

import mujoco
import numpy as np
from mujoco import mjtObj, mjtState
from numpy.typing import NDArray

from grader.numerics import needs as proofs
from grader.numerics.integrators import BY_CODE
from grader.numerics.process import prepare
from grader.numerics.recording import find_inputs
from grader.numerics.visuals import remove_visuals
from grader.numerics.workspace import Workspace, WorkspacePool

Vector = NDArray[np.float64]
Values = Sequence[float] | Vector

FULL_STATE = int(mjtState.mjSTATE_INTEGRATION)


@dataclass(frozen=True)
class State:
    """A named point of phase space: time [s], qpos (nq,), qvel (nv,), act (na,), ctrl (nu,); read-only arrays."""

    time_s: float
    qpos: Vector
    qvel: Vector
    act: Vector
    ctrl: Vector


@dataclass(frozen=True, eq=False)
class Scene:
    """A model with an initial state; build it with `Scene.from_xml` or `Scene.from_model`. Every run begins at `start`;
    `start_vector` is the whole integration state (mjSTATE_INTEGRATION), which includes mocap poses, equality switches
    and the warm start. `needs` are the parts of the engine that the model needs; `unconstrained` holds, by timestep [s]
    and integrator, the most steps of a run in which no contact was found and no constraint acted."""

    model: mujoco.MjModel
    start_vector: Vector
    start: State
    needs: tuple[proofs.Need, ...]
    _stock: WorkspacePool = field(repr=False)
    digest: str = ""
    unconstrained: dict[tuple[float, int], int] = field(init=False, repr=False, default_factory=dict)

    @staticmethod
    def from_xml(xml: str, *, key: int | str | None = None) -> "Scene":
        """Compile an MJCF text, cached by content, at `qpos0` or keyframe `key`. Raises ValueError if MuJoCo cannot
        compile the text, KeyError if there is no such keyframe."""
        return _compile(xml, key)

    @staticmethod
    def from_model(model: mujoco.MjModel, *, digest: str = "") -> "Scene":
        """Copy a model into a scene at `qpos0`."""
        prepare()
        model = copy.copy(model)
        return _build_scene(model, proofs.prove_needs(model), WorkspacePool(model), digest)

    def changed(self, change: Callable[[mujoco.MjModel], object]) -> "Scene":
        """Copy the model, let `change` write the copy, and prove its needs again; the start is kept."""
        model = copy.copy(self.model)
        change(model)
        return replace(self, model=model, needs=proofs.prove_needs(model), digest="", _stock=WorkspacePool(model))

    def at(
        self, *, key: int | str | None = None, qpos: Values | None = None, qvel: Values | None = None,
        act: Values | None = None, ctrl: Values | None = None, time_s: float | None = None,
    ) -> "Scene":  # fmt: skip
        """Returns the same model from another start; the given parts replace those of keyframe `key`, or of this start.
        Raises KeyError for an unknown keyframe, ValueError for a part of the wrong length."""
        with self.borrow() as workspace:
            data = workspace.data
            if key is not None:
                mujoco.mj_resetDataKeyframe(self.model, data, self.find_id(mjtObj.mjOBJ_KEY, key))
            for name, values in (("qpos", qpos), ("qvel", qvel), ("act", act), ("ctrl", ctrl)):
                if values is not None:
                    _write(getattr(data, name), values, name)
            if time_s is not None:
                data.time = time_s
            return replace(self, start_vector=_read_full_state(self.model, data), start=copy_state(data))

    @cached_property
    def flags(self) -> int:
        """The disable bits that are proved to change nothing."""
        return proofs.list_skippable_flags(self.needs)

    @cached_property
    def options(self) -> tuple[float, int]:
        """The timestep [s] and the integrator of the model itself."""
        return float(self.model.opt.timestep), int(self.model.opt.integrator)

    @cached_property
    def inputs(self) -> int | None:
        """The inputs at the start that `record_steps` takes; None for a scene with plug-ins, sleep or the like, whose
        state is more than what it records."""
        if any(need.needed and need.part == "everything" for need in self.needs):
            return None
        with self.borrow() as workspace:
            return find_inputs(workspace.model, workspace.data)

    @cached_property
    def _disabled(self) -> int:
        """The disable bits of the model itself."""
        return int(self.model.opt.disableflags)

    @contextmanager
    def borrow(
        self, *, timestep_s: float | None = None, integrator: int | None = None, skip: bool = False, keep: bool = True
    ) -> Iterator[Workspace]:
        """Lend a workspace at the start to one run; pass `keep=False` if the run may write its model. Raises ValueError
        as `lend`."""
        workspace = self.lend(timestep_s, integrator, skip=skip)
        workspace.known = None
        yield workspace
        if keep:  # not reached after an exception: the workspace is then discarded
            self.return_workspace(
                workspace, (workspace.data.time - self.start.time_s) / workspace.timestep_s if skip else 0
            )

    def lend(self, timestep_s: float | None = None, integrator: int | None = None, *, skip: bool = False) -> Workspace:
        """Returns a workspace at the start, for one run that only steps it; faster than `borrow` by 1 us. Raises
        ValueError for a timestep [s] that is not positive and finite, or an unknown integrator."""
        timestep_s, integrator = resolve_options(self.options, timestep_s, integrator)
        workspace = self._stock.take(skip=skip)
        option = workspace.option
        option.timestep, option.integrator = timestep_s, integrator
        workspace.timestep_s, workspace.integrator = timestep_s, integrator
        option.disableflags = self._disabled | self.flags if skip else self._disabled
        self.restart(workspace)
        return workspace

    def restart(self, workspace: Workspace) -> None:
        """Set a workspace that was lent to the start again."""
        workspace.known = self.start_vector
        mujoco.mj_resetData(workspace.model, workspace.data)
        mujoco.mj_setState(workspace.model, workspace.data, self.start_vector, FULL_STATE)

    def return_workspace(self, workspace: Workspace, steps: float) -> None:
        """Keep a workspace for later runs, unless its model was written or its run raised. `steps` is the number of
        steps that were taken with skipping on."""
        self._stock.give_back(workspace, steps)

    def list_names(self, kind: mjtObj) -> tuple[str, ...]:
        """Returns the names of all objects of a kind, in order; the index for an object without a name."""
        return tuple(mujoco.mj_id2name(self.model, kind, i) or str(i) for i in range(self._count(kind)))

    def find_id(self, kind: mjtObj, name: int | str) -> int:
        """The index of an object by name; an index is checked and returned. Raises KeyError if there is none."""
        names = self.list_names(kind)
        index = (names.index(name) if name in names else None) if isinstance(name, str) else name
        if index is None or not 0 <= index < len(names):
            known = ", ".join(sorted(names)) or "none"
            raise KeyError(f"no {kind.name[6:].lower()} {name!r}; there are: {known}")
        return index

    def _count(self, kind: mjtObj) -> int:
        sizes = {"KEY": "nkey", "JOINT": "njnt", "ACTUATOR": "nu", "BODY": "nbody", "SITE": "nsite"}
        return int(getattr(self.model, sizes[kind.name.removeprefix("mjOBJ_")]))

    def find_qpos(self, joint: int | str) -> slice:
        """Returns the slice of qpos with the coordinates of a joint."""
        index = self.find_id(mjtObj.mjOBJ_JOINT, joint)
        addresses = self.model.jnt_qposadr
        stop = addresses[index + 1] if index + 1 < len(addresses) else self.model.nq
        return slice(int(addresses[index]), int(stop))


def resolve_options(own: tuple[float, int], timestep_s: float | None, integrator: int | None) -> tuple[float, int]:
    """Returns the given timestep [s] and integrator, or the model's own. Raises ValueError for invalid ones."""
    timestep_s = own[0] if timestep_s is None else float(timestep_s)
    if not (isfinite(timestep_s) and timestep_s > 0):
        raise ValueError(f"the timestep must be positive and finite, not {timestep_s}")
    integrator = own[1] if integrator is None else int(integrator)
    if integrator not in BY_CODE:
        raise ValueError(f"there is no integrator {integrator}")
    return timestep_s, integrator


def copy_state(data: mujoco.MjData) -> State:
    """Returns a frozen copy of the state in `data`."""
    return State(float(data.time), *(freeze(values) for values in (data.qpos, data.qvel, data.act, data.ctrl)))


def freeze(values: Vector) -> Vector:
    """Returns a read-only copy."""
    values = np.array(values, dtype=np.float64)
    values.flags.writeable = False
    return values


@lru_cache(maxsize=128)
def _compile(xml: str, key: int | str | None) -> Scene:
    prepare()
    if key is not None:
        return _compile(xml, None).at(key=key)
    digest = hashlib.sha256(xml.encode()).hexdigest()
    model = mujoco.MjModel.from_xml_string(xml)
    needs = proofs.prove_needs(model)
    return _build_scene(model, needs, WorkspacePool(model, lambda: remove_visuals(xml, model, needs)), digest)


def _build_scene(model: mujoco.MjModel, needs: tuple[proofs.Need, ...], stock: WorkspacePool, digest: str) -> Scene:
    workspace = stock.take(skip=False)
    mujoco.mj_resetData(model, workspace.data)  # another model may have used it
    start_vector, start = _read_full_state(model, workspace.data), copy_state(workspace.data)
    stock.give_back(workspace, 0)
    return Scene(model, start_vector, start, needs, stock, digest)


def _read_full_state(model: mujoco.MjModel, data: mujoco.MjData) -> Vector:
    vector = np.empty(mujoco.mj_stateSize(model, FULL_STATE))
    mujoco.mj_getState(model, data, vector, FULL_STATE)
    return freeze(vector)


def _write(target: Vector, values: Values, name: str) -> None:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != target.shape:
        raise ValueError(f"{name} has {target.size} entries in this model, not {array.size}")
    target[:] = array
