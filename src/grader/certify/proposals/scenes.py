"""The simulations that a question may be about, written as `verify` writes them: controls at the author's values become
statements of `setup`."""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from grader.certify.wording import read_words
from grader.domain.lab import Button, LabConfig, OptionValue, Select, SimLab, Slider
from grader.domain.pages.markup import plain_text
from grader.errors import CallerError, GraderError
from grader.experiments.quantities import Floats
from grader.experiments.runs import LabRun, Variant, choose_length_s, run_experiment, to_numbers
from grader.expressions import RunError, Value
from grader.library import Library
from grader.questions import Question, kind_of

SCENES_MAX = 4
"""Simulations that are tried for a question without one of its own: each is run once."""

SHOWN_MAX = 8
"""Expressions of a simulation that are tried."""

STEPS_MAX = 20_000
"""Steps of a run that is tried: a second of computing."""

VALUE = re.compile(r"(?<![\w.$'\"])value(?![\w$'\"])")
IN_BRACKETS = re.compile(r"\s*[(\[]([^()\[\]]+)[)\]]\s*$")


@dataclass(frozen=True)
class ShownExpression:
    """An expression that a simulation shows, with its label, and the unit in which the author says it is."""

    expr: str
    label: str
    unit: str = ""


@dataclass(frozen=True)
class LabScene:
    """A lab with its MJCF; `is_own` says whether it is the question's own, `named` how many words of its title the
    question has."""

    lab: LabConfig
    xml: str
    is_own: bool
    named: int = 0

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The compiled model. Raises ValueError where MuJoCo cannot compile it."""
        return mujoco.MjModel.from_xml_string(self.xml)

    @cached_property
    def setup(self) -> str | None:
        """What happens before the run: every control at the author's value, the lab's `setup`, and the controls with
        `init` once more."""
        controls = [control for control in self.lab.controls if not isinstance(control, Button)]
        first = [text for control in controls for text in write_control(control)]
        again = [text for control in controls if control.init for text in write_control(control)]
        return "; ".join(filter(None, (*first, self.lab.setup, *again))) or None

    @cached_property
    def seconds(self) -> float:
        """The length of a run [s], up to the moment at which the lab would stop."""
        length = choose_length_s(self.lab)
        stop = self.lab.stopAt
        if isinstance(stop, str):
            return run_experiment(self.lab, self.xml, seconds=length, keys={}).duration_s
        return length if stop is None else min(length, float(stop))

    def list_shown(self) -> list[ShownExpression]:
        """Returns what the readouts and plots show, each expression once."""
        shown: dict[str, ShownExpression] = {}
        for readout in self.lab.readouts:
            shown.setdefault(readout.expr, read_label(readout.expr, readout.label, readout.unit or ""))
        for plot in self.lab.plots:
            for trace in plot.traces:
                shown.setdefault(trace.expr, read_label(trace.expr, trace.label, read_label_unit(plot.ylabel or "")))
        return list(shown.values())[:SHOWN_MAX]

    def list_joints(self) -> list[ShownExpression]:
        """Returns position and speed of every joint of one degree of freedom."""
        joints = []
        single = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
        for joint in range(self.model.njnt):
            if int(self.model.jnt_type[joint]) in single:
                name = self.model.joint(joint).name or f"joint {joint}"
                at, dof = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
                joints += [
                    ShownExpression(f"data.qpos[{at}]", name),
                    ShownExpression(f"data.qvel[{dof}]", f"speed of {name}"),
                ]
        return joints[:SHOWN_MAX]

    def run(self, exprs: list[str], seconds: float) -> LabRun:
        """Returns a run with a frame for every step and these expressions as readouts. Raises what `run_experiment`
        does, and GraderError where it takes too many steps."""
        steps = seconds / max(float(self.model.opt.timestep), 1e-9)
        if steps > STEPS_MAX:
            raise GraderError(f"a run of {seconds:g} s takes {steps:.0f} steps, and at most {STEPS_MAX} are tried")
        readouts = [{"label": expr, "expr": expr} for expr in exprs]
        config = LabConfig.model_validate(
            {"xml": self.xml, "key": self.lab.key, "setup": self.setup, "controller": self.lab.controller,
             "readouts": readouts}
        )  # fmt: skip
        return run_experiment(config, self.xml, seconds=seconds, variant=Variant(every_step=True), keys={})


def find_scenes(library: Library, quiz_id: str, question: Question) -> list[LabScene]:
    """Returns the question's own simulation; else those of its lesson: the labs that it names first, then the other
    labs, and what other questions show."""
    own = kind_of(question).lab(question)
    words = read_words(plain_text(question.q))
    labs = [own] if own is not None else [*list_labs_near(library, quiz_id)]
    scenes = []
    for lab in labs:
        named = len(read_words(lab.title or "") & words)
        try:
            scenes.append(LabScene(lab, lab.xml or library.model_xml(lab.model or ""), own is not None, named))
        except CallerError:
            continue
    return sorted(scenes, key=lambda scene: -scene.named)[:SCENES_MAX]


def list_labs_near(library: Library, quiz_id: str) -> Iterator[LabConfig]:
    """Yields the labs of a lesson, then the simulations of its questions, those of a quiz first, each once."""
    lesson = quiz_id.partition("-")[0]
    near = [quiz_id, *(other for other in library.quizzes if other != quiz_id and other.partition("-")[0] == lesson)]
    quizzes = [library.quiz(id_) for id_ in near]
    labs = [lab for quiz in quizzes for lab in quiz.labs if isinstance(lab, SimLab)]
    sims = [kind_of(question).lab(question) for quiz in quizzes for question in quiz.questions]
    seen: list[LabConfig] = []
    for lab in (*labs, *sims):
        if lab is not None and lab not in seen:
            seen.append(lab)
            yield lab


def read_numbers(column: Sequence[Value]) -> Floats:
    """Returns what an expression gave in each frame (n,); NaN where it is no number."""
    try:
        return to_numbers(column)
    except RunError:
        return np.array([np.nan])


def write_control(control: Slider | Select) -> list[str]:
    """Returns the statements that bring a control to the author's value."""
    value = control.value
    if value is None and isinstance(control, Select):
        value = control.options[0][1]
    written = write_value(value)
    texts = []
    if control.apply:
        texts.append(f"{{ {VALUE.sub(lambda _: f'({written})', control.apply)} }}")
    if control.set:
        texts.append(f"{control.set} = {written}")
    if control.param:
        texts.append(f"ctx.{control.param} = {written}")
    return texts


def write_value(value: OptionValue | None) -> str:
    """Returns an author's value as the language writes it; whole numbers without a point."""
    if isinstance(value, float) and value == int(value):
        return str(int(value))
    return json.dumps(list(value) if isinstance(value, tuple) else value)


def read_label(expr: str, label: str, unit: str) -> ShownExpression:
    """Returns an expression with its label as plain text, without the unit in brackets at its end."""
    text = plain_text(label)
    return ShownExpression(expr, IN_BRACKETS.sub("", text) or text, unit or read_label_unit(text))


def read_label_unit(label: str) -> str:
    """Returns what stands in brackets at the end of a label: the unit of `angle (rad)`."""
    match = IN_BRACKETS.search(plain_text(label))
    return match[1].strip() if match else ""
