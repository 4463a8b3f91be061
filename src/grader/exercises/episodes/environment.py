"""What an author's program says of an episode, in the parts of an environment of Gymnasium: how it begins, what is
observed, what a control period earns, and when the episode is over."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

FUNCTIONS = ("reset", "observe", "reward", "terminated")


@dataclass(frozen=True)
class Environment:
    """The functions of the program, None where it has none of a name: `reset(model, data, rng)` changes the start,
    `observe(model, data)` returns the observation, `reward(model, data, controls)` a number for the period that has
    passed under the controls that acted, `terminated(model, data)` whether the episode is over. Each but `reset` gets
    data that is forwarded, and must not change it."""

    reset: Callable[[mujoco.MjModel, mujoco.MjData, np.random.Generator], object] | None = None
    observe: Callable[[mujoco.MjModel, mujoco.MjData], Any] | None = None
    reward: Callable[[mujoco.MjModel, mujoco.MjData, NDArray[np.float64]], Any] | None = None
    terminated: Callable[[mujoco.MjModel, mujoco.MjData], Any] | None = None

    @classmethod
    def from_program(cls, program: Mapping[str, Any]) -> "Environment":
        """Takes the functions of a program. Raises ValueError where it has none of them."""
        functions = {name: program[name] for name in FUNCTIONS if callable(program.get(name))}
        if not functions:
            raise ValueError(f"it must define one of the functions {', '.join(FUNCTIONS)}")
        return cls(**functions)

    def begin(self, model: mujoco.MjModel, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """Has the program change the start, and forwards it. Raises ValueError for a state that is not finite."""
        assert self.reset is not None
        self.reset(model, data, rng)
        for name in ("qpos", "qvel", "act", "ctrl"):
            if not np.isfinite(getattr(data, name)).all():
                raise ValueError(f"`reset` of the author's program sets a number of data.{name} that is not finite")
        mujoco.mj_forward(model, data)

    def read_observation(self, model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
        """Returns what the program observes, in one row. Raises ValueError for what is no finite number."""
        assert self.observe is not None
        observed = np.array(self.observe(model, data), dtype=np.float64).ravel()
        if not np.isfinite(observed).all():
            raise ValueError("`observe` of the author's program returned a number that is not finite")
        return observed


NO_ENVIRONMENT = Environment()
