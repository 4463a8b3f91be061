"""Workspaces: models and data that runs borrow, one run at a time, and return.

Models of the same layout, such as those that differ in some numbers alone, share their workspaces: MuJoCo copies one
over another in a microsecond, where a new copy and its data take half a millisecond.
"""

import copy
import ctypes
import threading
from collections import deque
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from weakref import WeakValueDictionary

import mujoco
import numpy as np
from mujoco import mjtState
from numpy.typing import NDArray

BARE_AFTER = 20_000
"""Steps that the skipping runs of a scene take before a model without visuals is compiled. Source: measured on the
lesson's models; compiling it takes about 1 ms and saves 0.05 us a step."""

SHARED_BYTES_MAX = 1 << 20
"""The largest model whose workspaces other models use too: to copy a larger one takes longer than it saves."""

KEPT = int(mjtState.mjSTATE_TIME | mjtState.mjSTATE_QPOS | mjtState.mjSTATE_QVEL | mjtState.mjSTATE_ACT)
"""What a rollout keeps of a state, in this order: one call of `mj_getState` takes half the time of four assignments."""

_empty = mujoco.MjModel.from_xml_string("<mujoco/>")
SIZES = tuple(name for name in dir(_empty) if name.startswith("n") and type(getattr(_empty, name)) is int)
"""The sizes of a model, which lay out its arrays and those of its data."""

Layout = tuple[object, ...]
Strip = Callable[[], mujoco.MjModel | None]


def load_copier() -> Callable[[int, int], object] | None:
    """Returns mj_copyModel, which takes the addresses of two models and which MuJoCo's Python package lacks; None where
    its library is not in the package."""
    folder = Path(mujoco.__file__).parent
    path = next((path for name in ("libmujoco.*", "mujoco.dll") for path in folder.glob(name)), None)
    if path is None:
        return None
    function = ctypes.CDLL(str(path)).mj_copyModel
    function.argtypes, function.restype = (ctypes.c_void_p, ctypes.c_void_p), ctypes.c_void_p
    return function


_copy_model = load_copier()


class Workspace:
    """A model and its data, for one run at a time.

    `counts` (7,) is a view of the warning counters, and `warned` the same for `any`, ten times as fast. `timestep_s`
    [s] and `integrator` are those with which it was lent. `known` is the whole integration state at which the data
    stands, None where it may have been written since; `saved` is room for one. `columns` are the slices of qpos, qvel
    and act in a row of KEPT, which has `width` entries.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.source = model
        self.model = copy.copy(model)
        self.data = mujoco.MjData(self.model)
        self.option = self.model.opt
        self.counts: NDArray[np.int32] = self.data.warning.number
        self.warned = memoryview(self.counts)
        self.known: NDArray[np.float64] | None = None
        self.saved = np.empty(mujoco.mj_stateSize(self.model, int(mjtState.mjSTATE_INTEGRATION)))
        bounds = np.cumsum([1, model.nq, model.nv, model.na]).tolist()
        self.columns = tuple(slice(low, high) for low, high in pairwise(bounds))
        self.width: int = bounds[-1]
        self.timestep_s, self.integrator = 0.0, 0

    def load(self, model: mujoco.MjModel) -> None:
        """Copies another model of the same layout over this one; the data is then of no meaning until it is reset."""
        assert _copy_model is not None
        _copy_model(self.model._address, model._address)
        self.source, self.known = model, None


class Idle(deque[Workspace]):
    """The workspaces of a layout that no run uses, the last used one at the end."""


_shared: WeakValueDictionary[Layout, Idle] = WeakValueDictionary()
_sharing = threading.Lock()


def find_idle(model: mujoco.MjModel) -> Idle:
    """Returns the workspaces that runs of a model may use; they live as long as a pool that uses them."""
    if _copy_model is None or model.nplugin or mujoco.mj_sizeModel(model) > SHARED_BYTES_MAX:
        return Idle()
    layout = *(getattr(model, name) for name in SIZES), model.names
    with _sharing:
        return _shared.setdefault(layout, Idle())


class WorkspacePool:
    """The free workspaces of a scene, shared with other models of its layout; thread-safe. Runs that skip parts get
    workspaces of a bare model, without visuals, after BARE_AFTER steps. `strip` compiles it, or returns None if it
    would not differ."""

    def __init__(self, model: mujoco.MjModel, strip: Strip | None = None) -> None:
        self._whole = model
        self._bare: mujoco.MjModel | None = None
        self._strip = strip
        self._steps = 0
        self._idle = {False: find_idle(model)}

    def take(self, *, skip: bool) -> Workspace:
        """Take a workspace for one run; its data is as the last run left it."""
        if skip and self._strip is not None and self._steps >= BARE_AFTER:
            strip, self._strip = self._strip, None
            bare = strip()
            if bare is not None:
                self._idle[True] = find_idle(bare)
                self._bare = bare  # last: other threads look for it
        model = self._bare if skip and self._bare is not None else self._whole
        try:
            workspace = self._idle[model is self._bare].pop()
        except IndexError:
            return Workspace(model)
        if workspace.source is not model:
            workspace.load(model)
        return workspace

    def give_back(self, workspace: Workspace, steps: float) -> None:
        """Return a workspace; `steps` is the number of steps taken with skipping on."""
        if self._strip is not None and steps > 0:  # false for negative numbers and NaN
            self._steps += round(min(steps, BARE_AFTER))
        self._idle[workspace.source is self._bare].append(workspace)
