"""Certifies keys of questions about mj_step: calls its stages one by one to find which fills a field of mjData."""

from collections.abc import Sequence

import mujoco
import numpy as np

from grader.certify.certificate import Certificate, certify_choice, refuse
from grader.domain.pages.markup import plain_text
from grader.domain.verify import ByStage
from grader.experiments.runs import DATA_FIELDS, VerifyError, read_xml
from grader.questions import ModelXml, OptionKey

CALLS = (
    "mj_checkPos",
    "mj_checkVel",
    "mj_fwdPosition",
    "mj_fwdVelocity",
    "mj_fwdActuation",
    "mj_fwdAcceleration",
    "mj_fwdConstraint",
    "mj_checkAcc",
    "mj_Euler",
)
"""The calls of mj_step in their order, for a model with the Euler integrator. Source: engine_forward.c of 3.14.0."""

BEHIND = {
    "mj_fwdPosition": ("mj_sensorPos", "mj_energyPos"),
    "mj_fwdVelocity": ("mj_sensorVel", "mj_energyVel"),
    "mj_fwdConstraint": ("mj_sensorAcc",),
}
"""The calls of mj_forward behind those of its stages, which fill sensors and energies."""

INPUTS = frozenset(
    {"ctrl", "qfrc_applied", "xfrc_applied", "eq_active", "mocap_pos", "mocap_quat", "userdata"}
)  # fmt: skip
"""Fields that mj_step reads, and does not write."""

WORDS = {
    "position": "mj_fwdPosition",
    "velocity": "mj_fwdVelocity",
    "actuation": "mj_fwdActuation",
    "acceleration": "mj_fwdAcceleration",
    "constraint": "mj_fwdConstraint",
    "integrat": "mj_Euler",
    "euler": "mj_Euler",
}

IN_CONTACT = """
<mujoco><worldbody>
  <geom type="plane" size="1 1 .1"/>
  <body pos="0 0 .09"><freejoint/><geom size=".1"/></body>
</worldbody></mujoco>
"""


def find_stage(option: str) -> str | None:
    """Returns the call that the words of an option name, or None."""
    words = plain_text(option).lower()
    return next((call for word, call in WORDS.items() if word in words), None)


def certify_stage(key: OptionKey, verify: ByStage, model_xml: ModelXml) -> Certificate:
    """Find the option that names the call which first fills the field."""
    stages = verify.stages or tuple(map(find_stage, key.options))
    if len(stages) != len(key.options) or not set(stages) <= {None, *CALLS}:
        return refuse("stage", key.answer, f"verify.stages needs one of {', '.join(CALLS)} for each option")
    words = tuple(map(find_stage, key.options))
    if None not in words and words != stages and len({*words}) == len(words) and {*words} == {*stages}:
        why = f"verify.stages are exchanged: the words of the options name {', '.join(filter(None, words))}"
        return refuse("stage", key.answer, why, key="verify.stages")
    named = verify.model or verify.xml
    xml = read_xml(verify.model, verify.xml, model_xml) if named else IN_CONTACT
    if verify.fills != "contact" and verify.fills not in DATA_FIELDS:
        raise VerifyError("verify", f"verify.fills must be contact or an array of the data, not {verify.fills!r}")
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    observed = min((_observe(model, verify.fills, is_moving=moving) for moving in (False, True)), key=find_first_change)
    first = find_first_change(observed)
    measured = {
        "field": f"data.{verify.fills}",
        "filled by": CALLS[first] if first < len(CALLS) else None,
        "calls": {call: before if after == before else f"{before}, then {after}"
                  for call, (before, after) in zip(CALLS, observed, strict=True)},
    }  # fmt: skip
    if first == len(CALLS):
        why = (
            f"data.{verify.fills} is an input of mj_step, which no stage fills: ask for another field"
            if verify.fills in INPUTS
            else f"no stage of mj_step changes data.{verify.fills} in this model: name a `model` in which one does"
        )
        return refuse("stage", key.answer, why, key="verify.fills", measured=measured)
    right = [i for i, stage in enumerate(stages) if stage == CALLS[first]]
    if not right and verify.stages is None and None in stages:
        unknown = key.options[stages.index(None)]
        why = (
            f"{CALLS[first]} fills data.{verify.fills}, and the option {plain_text(unknown)!r} names no stage of "
            "mj_step: write verify.stages, the call of each option"
        )
        return refuse("stage", key.answer, why, key="verify", measured=measured)
    return certify_choice("stage", right, key.answer, key.options, measured)


Observed = Sequence[tuple[str, str]]
"""The summaries of a field before and after each call of mj_step."""


def find_first_change(observed: Observed) -> int:
    """Returns the index of the first call that changes the field; their number where none does."""
    return next((index for index, (before, after) in enumerate(observed) if before != after), len(observed))


def _observe(model: mujoco.MjModel, field: str, *, is_moving: bool) -> Observed:
    """Summarise the field before and after each call of mj_step, from the model's start, or in motion with controls:
    what a stage computes of a start at rest may be the 0 that stood there before."""
    data = mujoco.MjData(model)
    mujoco.mj_resetData(model, data)
    if is_moving:
        data.qvel[:] = np.linspace(0.1, 0.2, model.nv)
        data.act[:], data.ctrl[:] = 0.5, 1.0
        mujoco.mj_integratePos(model, data.qpos, data.qvel, 1.0)
    observed = []
    for name in CALLS:
        before = _shorten(data, field)
        for call in (name, *BEHIND.get(name, ())):
            if "energy" not in call or model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_ENERGY:
                getattr(mujoco, call)(model, data)
        observed.append((before, _shorten(data, field)))
    return observed


def _shorten(data: mujoco.MjData, field: str) -> str:
    """Return the number of contacts, or the sum of magnitudes of an array with all digits."""
    if field == "contact":
        return f"{data.ncon} contacts"
    return repr(float(abs(getattr(data, field)).sum()))
