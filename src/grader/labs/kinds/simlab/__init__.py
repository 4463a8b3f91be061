"""The `simlab` kind: one scene with the author's controls, readouts and plots. The `sim` of a question is run by it."""

from collections.abc import Iterator, Mapping
from typing import Any

from grader.domain.lab import OVERLAYS, LabConfig, SimLab
from grader.domain.plugins import Remark
from grader.errors import ContentError, Fault
from grader.labs.bench import Bench, Limits
from grader.labs.kind import LabExample, LabKind, LabRequest, ModelXml
from grader.labs.kinds.simlab.skeleton import build_skeleton, build_view
from grader.labs.programs import compile_lab
from grader.labs.trials import NEITHER_MODEL, check_lab
from grader.labs.watching import watch_lab

PENDULUM = """<mujoco><worldbody><body pos="0 0 1"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1"/></body></worldbody></mujoco>"""


class Simlab(LabKind[LabConfig, LabRequest]):
    """A scene, whose settings are the labels of its controls."""

    lab = SimLab
    limits = Limits(cpu_s=60.0, answer_bytes=64 << 20)
    """Above what `run_lab` itself refuses: a close-up is a second run, and up to 60 s have a frame for each 60th."""

    def faults(self, lab: LabConfig) -> Iterator[Remark]:
        """Yields what cannot be compiled of the author's expressions."""
        try:
            compile_lab(lab, "lab")
        except ContentError as error:
            yield from (Remark(fault.key.removeprefix("lab."), fault.why) for fault in error.faults)

    def warnings(self, lab: LabConfig) -> Iterator[Remark]:
        """Yields the overlays that are not drawn."""
        if more := [name for name in lab.over_the_scene if name not in OVERLAYS]:
            yield Remark("overlays", f"{', '.join(more)}: not drawn; what can be drawn are {', '.join(OVERLAYS)}")

    def check(self, lab: LabConfig, where: str, model_xml: ModelXml) -> list[Fault]:
        """Runs it whole, and at both ends of every control."""
        if (not lab.model) == (lab.xml is None):
            return [Fault("", f"{where}.model", NEITHER_MODEL)]
        return check_lab(lab, read_xml(lab, model_xml), where)

    def view(self, lab: LabConfig) -> dict[str, Any]:
        """Returns the controls, and the labels of readouts and traces, without expressions or MJCF."""
        return build_view(lab)

    def skeleton(self, lab: LabConfig) -> dict[str, Any]:
        """Returns the height of the stage, and where the sliders stand."""
        return build_skeleton(lab)

    def read(self, lab: LabConfig, request: LabRequest) -> LabRequest:
        """Leaves it to the run, which knows the controls."""
        return request

    def run(self, lab: LabConfig, settings: LabRequest, bench: Bench) -> Mapping[str, Any]:
        """Records the frames of a run."""
        xml = read_xml(lab, bench.read_model)
        run = watch_lab(lab, xml, settings.controls, settings.events, settings.seconds, pulls=settings.pulls)
        bench.steps += run.steps
        return run.to_json()

    def example(self) -> LabExample:
        """Returns a pendulum."""
        lab = {
            "kind": "simlab",
            "title": "A pendulum",
            "model": "pendulum_of_simlab",
            "setup": "data.qpos[0] = 1",
            "seconds": 1,
            "controls": [{"label": "gravity", "set": "model.opt.gravity[2]", "min": -10, "max": 0, "value": -9.81}],
            "readouts": [{"label": "angle", "expr": "data.qpos[0]", "unit": "rad"}],
            "plots": [{"ylabel": "angle (rad)", "traces": [{"label": "angle", "expr": "data.qpos[0]"}]}],
        }
        return LabExample(
            lab, [{"gravity": -1.0}], [{"gravity": 1.0}, {"mass": 1.0}], {"models/pendulum_of_simlab.xml": PENDULUM}
        )


def read_xml(lab: LabConfig, model_xml: ModelXml) -> str:
    """Returns the MJCF of a lab: its own, or that of the model that it names. Raises NotFound."""
    return lab.xml if lab.xml is not None else model_xml(lab.model or "")
