"""The `integrators` kind: one scene under all five integrators from one state, energy and cost side by side."""

from collections.abc import Mapping
from typing import Any

from grader.errors import Fault, LabRefused
from grader.labs.bench import Bench, Limits
from grader.labs.controls import Wish
from grader.labs.kind import LabExample, LabKind, LabRequest, ModelXml
from grader.labs.kinds.integrators.comparison import STEPS_MAX, check_setting, run_integrators
from grader.labs.kinds.integrators.lab import IntegratorsLab, IntegratorsSettings
from grader.labs.trials import NEITHER_MODEL, try_run

HEIGHT = 264
"""The height of the chart [px]."""

PENDULUM = """<mujoco><worldbody><body pos="0 0 1"><joint axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1"/></body></worldbody>
<keyframe><key name="horizontal" qpos="1.57"/></keyframe></mujoco>"""


class Integrators(LabKind[IntegratorsLab, IntegratorsSettings]):
    """All five integrators."""

    lab = IntegratorsLab
    settings = IntegratorsSettings
    limits = Limits(steps=5 * STEPS_MAX, cpu_s=120.0)

    def check(self, lab: IntegratorsLab, where: str, model_xml: ModelXml) -> list[Fault]:
        """Runs a few steps, and looks at the whole length."""
        if not lab.model:
            return [Fault("", f"{where}.model", NEITHER_MODEL)]
        return check_integrators(lab, model_xml(lab.model), where)

    def view(self, lab: IntegratorsLab) -> dict[str, Any]:
        """Returns all that the author says."""
        return lab.model_dump(mode="json", include={"model", "models", "timestep", "seconds"})

    def skeleton(self, lab: IntegratorsLab) -> dict[str, Any]:
        """Returns the height of the chart, and the models to choose from."""
        return {"height": HEIGHT, "offered": lab.offered}

    def read(self, lab: IntegratorsLab, request: LabRequest) -> IntegratorsSettings:
        """Reads the settings; the length may be given as that of any run."""
        if request.events or request.pulls:
            raise LabRefused("This lab has no buttons, and nothing to pull.")
        seconds = {} if request.seconds is None else {"seconds": request.seconds}
        try:
            read = IntegratorsSettings.model_validate(seconds | {**request.controls}, strict=True)
        except ValueError as error:
            raise LabRefused(
                "This lab takes `model`, `key` (a keyframe's name), `timestep` [s] and `seconds`."
            ) from error
        if read.model is not None and read.model not in lab.offered:
            raise LabRefused(f"model must be one of: {', '.join(lab.offered)}.")
        return read

    def run(self, lab: IntegratorsLab, settings: IntegratorsSettings, bench: Bench) -> Mapping[str, Any]:
        """Measures the drift of the energy under each integrator."""
        xml = bench.read_model(settings.model or lab.model)
        try:
            shown = run_integrators(lab, xml, **settings.model_dump())
        except KeyError as error:
            raise LabRefused(f"There is {error.args[0]}.") from error
        bench.steps += sum(run.steps for run in shown.runs)
        return shown.to_json()

    def example(self) -> LabExample:
        """Returns a pendulum."""
        lab = {"kind": "integrators", "title": "Five integrators", "model": "pendulum_of_integrators", "seconds": 0.2}
        taken: list[Mapping[str, Wish]] = [
            {"timestep": 0.01},
            {"model": "pendulum_of_integrators", "key": "horizontal"},
        ]
        refused: list[Mapping[str, Wish]] = [{"timestep": 7.0}, {"model": "none"}, {"key": "vertical"}, {"step": 1}]
        return LabExample(lab, taken, refused, {"models/pendulum_of_integrators.xml": PENDULUM})


def check_integrators(lab: IntegratorsLab, xml: str, where: str) -> list[Fault]:
    """Returns everything that is wrong with the lab, with keys that begin with `where`."""

    def run() -> None:
        run_integrators(lab, xml, seconds=min(lab.seconds, 10 * lab.timestep))
        check_setting(lab, lab.model, lab.timestep, lab.seconds)

    return try_run(run, where, refused=".timestep", model=".model")
