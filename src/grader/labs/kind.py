"""LabKind: the one interface through which every room asks a kind of lab."""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import isfinite
from typing import Any, Generic, NamedTuple, TypeVar, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from grader.domain.lab import LabPart
from grader.domain.plugins import Remark
from grader.errors import Fault, GraderError, LabError, LabRefused, NotFound
from grader.labs.bench import Bench, Limits
from grader.labs.controls import Wish
from grader.labs.pulls import Pull

L = TypeVar("L", bound=LabPart)
S = TypeVar("S")

ModelXml = Callable[[str], str]
"""Returns the MJCF text of a model of the content folder by name; raises NotFound if there is none."""

TEMPLATE, SCRIPT = "lab.html", "lab.js"
"""The files beside the kind's module: its Jinja macros, and the ES module that draws. CONTRIBUTING.md says what is in
them."""


@dataclass(frozen=True)
class LabRequest:
    """What a learner asks a lab for: values by name, presses of buttons (time [s] and label), pulls, and the length of
    the run [s]. Nothing of it is checked yet, but that the values are finite numbers, texts, true or false."""

    controls: Mapping[str, Wish] = field(default_factory=dict)
    events: Sequence[tuple[float, str]] = ()
    pulls: Sequence[Pull] = ()
    seconds: float | None = None


class LabSettings(BaseModel):
    """Base of the settings of a run: unknown names and numbers that are not finite are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class LabAnswer(NamedTuple):
    """The JSON that the page gets, and how many steps it took."""

    body: bytes
    steps: int


@dataclass(frozen=True)
class LabExample:
    """A lab as its author writes it, without `id`; settings that runs take, and others that they must refuse, at least
    one of each. `files` are the other files of the content folder that the lab needs, by path: models."""

    lab: Mapping[str, Any]
    taken: Sequence[Mapping[str, Wish]]
    refused: Sequence[Mapping[str, Wish]]
    files: Mapping[str, str] = field(default_factory=dict)


class LabKind(ABC, Generic[L, S]):
    """A kind of lab, found through the entry-point group `grader.lab_kinds`. `L` is the model of the author's keys, `S`
    the settings of a run once they are read. A kind must define `lab`, `settings`, `run` and `example`, and have the
    template lab.html and the script lab.js beside its module; the rest has defaults. No method may change anything or
    keep state: one object serves all threads."""

    lab: type[L]
    """The author's keys: a model that derives from Lab, with `kind` a Literal of the names that choose this kind. The
    keys `model` and `models`, at any depth, are names of models of the content folder: others are refused."""

    settings: type[LabSettings]
    """What a learner may set: a model that derives from LabSettings, whose fields are numbers, texts, true or false."""

    limits: Limits = Limits()
    """What one run may use."""

    @property
    def names(self) -> tuple[str, ...]:
        """The values of `kind` in authors' JSON that choose this kind."""
        return get_args(self.lab.model_fields["kind"].annotation)

    @abstractmethod
    def example(self) -> LabExample:
        """Returns a lab with settings: the tests walk them through the page, the API and the commands."""

    # The author's part.

    def faults(self, lab: L) -> Iterator[Remark]:
        """Yields what is wrong with a lab beyond its model, without running it; content with a fault is refused."""
        yield from ()

    def warnings(self, lab: L) -> Iterator[Remark]:
        """Yields what may surprise the author; it does not prevent serving."""
        yield from ()

    def trials(self, lab: L) -> Sequence[Mapping[str, Wish]]:
        """Returns the settings that are tried when content is loaded: by default none but the author's own. With both
        ends of each range nothing can fail later that was not met then."""
        return ({},)

    def check(self, lab: L, where: str, model_xml: ModelXml) -> list[Fault]:
        """Returns everything that is wrong with a lab, with keys that begin with `where`: its `faults`, or where there
        are none what fails first of `view`, `skeleton` and `trials`."""
        faults = [Fault("", f"{where}.{key}" if key else where, why) for key, why in self.faults(lab)]
        if faults:
            return faults
        if why := _try(lambda: write_json({**self.view(lab), **self.skeleton(lab)})):
            return [Fault("", where, why)]
        for controls in self.trials(lab):
            if why := _try(partial(self.answer, lab, LabRequest(controls), model_xml)):
                setting = ", ".join(f"{name} = {value}" for name, value in controls.items())
                return [Fault("", where, f"{why} (with {setting})" if setting else why)]
        return []

    # What a learner sees.

    def view(self, lab: L) -> dict[str, Any]:
        """Returns, as plain JSON, what a learner may see beside id, kind, title and note: the page, its script and the
        API have it. Name each key: what is not named stays hidden."""
        return {}

    def skeleton(self, lab: L) -> dict[str, Any]:
        """Returns what the template needs beside `view`, such as sizes. It is called for every page: compute nothing
        here that takes longer than a millisecond."""
        return {}

    # A learner's run.

    def defaults(self, lab: L) -> Mapping[str, Wish]:
        """Returns the author's values of `settings`, where the learner gives none."""
        return {}

    def read(self, lab: L, request: LabRequest) -> S:
        """Reads what a learner asks for. Raises LabRefused with a sentence: what is not taken, and what would be."""
        if request.events or request.pulls or request.seconds is not None:
            raise LabRefused("This lab has no buttons, nothing to pull, and no length to choose.")
        try:
            read: S = self.settings.model_validate({**self.defaults(lab), **request.controls}, strict=True)  # type: ignore[assignment]
        except ValidationError as error:
            raise LabRefused(self._explain(error)) from error
        return read

    def _explain(self, error: ValidationError) -> str:
        """Returns the first thing that is wrong with settings."""
        first = error.errors(include_url=False, include_input=False)[0]
        name = ".".join(map(str, first["loc"]))[:80]
        if first["type"] == "extra_forbidden":
            return f"There is no setting {name!r} here; the settings are: {', '.join(self.settings.model_fields)}."
        why = first["msg"].removeprefix("Value error, ").replace("Input should", "must", 1)
        return f"{name}: {why}." if name else f"{why}."

    @abstractmethod
    def run(self, lab: L, settings: S, bench: Bench) -> Mapping[str, Any]:
        """Runs the lab, and returns what the script draws: JSON, in which NumPy's arrays and numbers may stand, and
        what is no finite number becomes null. Models come from `bench`, which also steps: so that steps are counted,
        and a run that takes too long ends; a loop without steps calls `bench.check_time`. Raises LabRefused with a
        sentence for settings that the lab cannot run with."""

    def answer(self, lab: L, request: LabRequest, model_xml: ModelXml) -> LabAnswer:
        """Reads a request, runs the lab within the limits, and returns what the page gets. Not for kinds to change.
        Raises LabRefused, LabError."""
        for name, value in request.controls.items():
            if isinstance(value, float) and not isfinite(value):
                raise LabRefused(f"{name[:80]} must be a finite number.")
        settings, bench = self.read(lab, request), Bench(model_xml, self.limits)
        body = write_json(self.run(lab, settings, bench))
        if len(body) > self.limits.answer_bytes:
            most = f"{self.limits.answer_bytes / 2**20:g} MB"
            raise LabRefused(f"The answer of this run is larger than {most}: ask for less in one run.")
        return LabAnswer(body, bench.steps)


def _try(work: Callable[[], object]) -> str:
    """Returns why something that a kind does fails; empty where it does not."""
    try:
        work()
    except (LabRefused, NotFound) as error:
        return str(error)
    except LabError as error:
        return error.why
    except Exception as error:  # code of another package: anything may be raised
        return f"its kind fails: {type(error).__name__}: {error}"
    return ""


def write_json(value: Any) -> bytes:
    """Returns JSON without spaces. Raises GraderError for what JSON does not have."""
    try:
        try:
            text = json.dumps(value, allow_nan=False, separators=(",", ":"), default=_to_plain)
        except ValueError:  # a number that is not finite
            text = json.dumps(_without_nan(value), allow_nan=False, separators=(",", ":"))
    except (TypeError, ValueError, RecursionError) as error:
        raise GraderError(f"what a kind of lab returned cannot be written as JSON: {error}") from error
    return text.encode(errors="surrogatepass")


def _to_plain(value: Any) -> Any:
    """Returns NumPy's arrays and numbers as JSON has them. Raises TypeError for anything else."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is no part of JSON")


def _without_nan(value: Any) -> Any:
    """Returns the value with null in place of numbers that are not finite."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not isfinite(value) else value
