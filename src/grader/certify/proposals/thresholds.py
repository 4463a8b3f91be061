"""The largest stable timestep of a simulation, as a `verify` of a number."""

from collections.abc import Iterator

import numpy as np
from pydantic import ValidationError

from grader.certify.proposals.scenes import LabScene
from grader.certify.proposals.trying import BROKEN, certify_with
from grader.domain.lab import Button
from grader.domain.verify import ByThreshold
from grader.experiments.runs import build_lab_scene
from grader.numerics.integrators import INTEGRATORS
from grader.questions import ModelXml, NumberKey

SMALL_SPEED = 0.1
"""Speed of every joint [rad/s, m/s] where a simulation starts at rest."""


def list_thresholds(key: NumberKey, scene: LabScene, model_xml: ModelXml) -> Iterator[tuple[ByThreshold, float, str]]:
    """Yields the linear stability limit under the model's own integrator, where the simulation is no more than a model
    with other fields and a start: a `verify` of this kind runs neither a controller nor statements."""
    lab = scene.lab
    if lab.controller or "model." in (lab.setup or ""):
        return
    fields = {}
    for control in lab.controls:
        if isinstance(control, Button) or (control.set or "").startswith(("model.opt.timestep", "data.", "ctx.")):
            continue
        if control.apply or not control.set or not isinstance(control.value, int | float):
            return
        if control.set != "model.opt.integrator":
            fields[control.set] = control.value
    try:
        built = build_lab_scene(lab, scene.xml)
        start, model = built.start, built.model
        resting = not np.any(start.qvel)
        named = {"xml": lab.xml} if lab.xml else {"model": lab.model}
        code = int(model.opt.integrator)
        verify = ByThreshold.model_validate(
            {"by": "threshold", **named, "qpos": start.qpos.tolist(), "set": fields,
             "qvel": [SMALL_SPEED] * model.nv if resting else start.qvel.tolist(),
             "integrator": next(integrator.name for integrator in INTEGRATORS if integrator.code == code)}
        )  # fmt: skip
    except (*BROKEN, ValidationError):
        return
    certificate = certify_with(key, verify, model_xml)
    if certificate is not None and certificate.answer is not None:
        yield verify, float(certificate.answer), f"the largest stable timestep under {verify.integrator}"
