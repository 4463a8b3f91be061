"""The parameters of a `controller` exercise."""

from typing import Literal, Self

from pydantic import Field, model_validator

from grader.domain.numbers import Positive, Range
from grader.exercises.episodes.parameters import EpisodesParameters


class ControllerParameters(EpisodesParameters):
    """`law` names observed sensors, or `target`, with the range of the gains that are sensible there, which names
    mistakes and judges nothing."""

    form: Literal["make", "control"] = "make"
    observe: tuple[str, ...] = Field(min_length=1, max_length=20)
    law: dict[str, Range] = Field(default_factory=dict)
    cpu_s: Positive | None = Field(default=None, le=120)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if unknown := self.law.keys() - {*self.observe, "target"}:
            raise ValueError(f"`law` names {min(unknown)}, which is not in `observe`")
        if self.track not in self.observe:
            raise ValueError("`observe` must name the sensor of `track`")
        if self.form == "control" and any(case.noise for case in self.cases):
            raise ValueError('`noise` is for the form "make": with "control" the function gets the state itself')
        return self
