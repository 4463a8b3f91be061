"""The keys of a lab that compares integrators, and what a learner may set."""

from typing import Any, Literal

from pydantic import AliasChoices, Field

from grader.domain.lab import OPTIONS_MAX, Lab, Seconds
from grader.domain.numbers import Positive
from grader.labs.kind import LabSettings


def _first_model(fields: dict[str, Any]) -> str:
    """The name of the first of `models`; "" where there is none."""
    first = next(iter(fields.get("models", ())), "")
    return str(first[0] if isinstance(first, tuple) else first)


class IntegratorsLab(Lab):
    """A lab of a lesson that runs one scene under all five integrators from one state. `models` are names, or pairs of
    name and label; without `model` it begins with the first. `duration` is another word for `seconds`."""

    kind: Literal["integrators"]
    models: tuple[str | tuple[str, str], ...] = Field(default=(), max_length=OPTIONS_MAX)
    model: str = Field(default_factory=_first_model)
    key: int | str | None = None
    timestep: Positive = 0.002
    seconds: Seconds = Field(default=20.0, validation_alias=AliasChoices("seconds", "duration"))

    @property
    def offered(self) -> dict[str, str]:
        """The label of every model that may be chosen, by name."""
        pairs = [model if isinstance(model, tuple) else (model, model) for model in self.models]
        return {self.model: self.model} | dict(pairs)


class IntegratorsSettings(LabSettings):
    """What a learner may set; None: as the author wrote it. `key` is a keyframe's name, "" for none."""

    model: str | None = None
    key: str | None = None
    timestep: float | None = None
    seconds: float | None = None
