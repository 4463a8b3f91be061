"""What a lab shows after a step of RK4 belongs to the state that it shows, and showing it changes no bit of the run."""

from typing import Any

import mujoco
import numpy as np
import pytest

from grader.domain.lab import LabConfig
from grader.labs import run_lab
from grader.labs.record import LabRun
from grader.labs.runs import LabSimulation, Variant
from grader.numerics.integrators import EULER, IMPLICITFAST, RK4, Integrator
from numerics.models import ALL, hinge

STEPS = 60
SHOWN = 30  # a lab has at most 40 readouts
ENERGY = "data.energy[0] + data.energy[1]"
PUSH = "for (let i = 0; i < model.nv; i++) data.qvel[i] += 0.3 * (i + 1)"
FREE_JOINT = hinge(rest='<option timestep="0.01"/><keyframe><key qpos="2"/></keyframe>')


def run(xml: str, *readouts: str, integrator: int = RK4.code, as_stepped: bool = False, **keys: Any) -> LabRun:
    config = LabConfig.model_validate(
        {"xml": xml, "readouts": [{"label": expr, "expr": expr} for expr in readouts], **keys}
    )
    timestep_s = float(mujoco.MjModel.from_xml_string(xml).opt.timestep)
    variant = Variant(integrator=integrator, every_step=True, as_stepped=as_stepped)
    return run_lab(config, xml, seconds=STEPS * timestep_s, variant=variant)


@pytest.mark.parametrize("name", sorted(ALL))
def test_the_run_itself_is_bitwise_that_of_mj_step(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(ALL[name])
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    model.opt.integrator = RK4.code
    data = mujoco.MjData(model)
    data.qvel[:] += 0.3 * np.arange(1, model.nv + 1)
    mujoco.mj_forward(model, data)
    stepped = [[*data.qpos, *data.qvel]]
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        stepped.append([*data.qpos, *data.qvel])
    state = [f"data.qpos[{i}]" for i in range(model.nq)] + [f"data.qvel[{i}]" for i in range(model.nv)]
    state = state[:SHOWN]
    shown = run(ALL[name], *state, "data.xpos[0]", setup=PUSH)
    assert shown.rederived
    assert len(shown.rows) == len(stepped)
    assert np.array([row[:-1] for row in shown.rows]).tobytes() == np.array(stepped)[:, :SHOWN].tobytes()


@pytest.mark.parametrize("name", sorted(ALL))
def test_a_state_alone_is_shown_without_deriving_anything(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(ALL[name])
    state = [f"data.qpos[{i}]" for i in range(min(model.nq, SHOWN // 2))]
    state += [f"Math.abs(data.qvel[{i}]) + data.time" for i in range(min(model.nv, SHOWN // 2))]
    alone = run(ALL[name], *state, setup=PUSH)
    among = run(ALL[name], *state, "data.xpos[0]", setup=PUSH)
    assert (alone.rederived, among.rederived) == (False, True)
    assert repr(alone.rows) == repr([row[:-1] for row in among.rows])


@pytest.mark.parametrize(
    "changes", ["(data.qpos[0] = 2)", "data.qpos.fill(3)[0]", "(a => a[0]++)(data.qpos)", "data.qvel.set([4])"]
)
def test_a_readout_that_writes_is_shown_from_a_copy(changes: str) -> None:
    assert run(FREE_JOINT, changes, key=0).rederived


def test_energy_and_positions_are_those_of_the_state() -> None:
    shown = run(FREE_JOINT, "data.qpos[0]", "data.qvel[0]", ENERGY, "lib.sitePos('tip')[2]", key=0)
    stepped = run(FREE_JOINT, "data.qpos[0]", "data.qvel[0]", ENERGY, "lib.sitePos('tip')[2]", key=0, as_stepped=True)
    angle, rate, energy, height = (np.array(column) for column in shown.readouts)
    # Source: I = m l^2 + I_c = 0.251 kg m2; the tip hangs 0.5 m below the hinge, at 1 m.
    assert height == pytest.approx(1 - 0.5 * np.cos(angle), abs=1e-12)
    assert energy == pytest.approx(9.81 * (1 - 0.5 * np.cos(angle)) + 0.251 * rate**2 / 2, abs=1e-9)
    assert np.ptp(energy) < np.ptp(np.array(stepped.readouts[2])) / 3
    assert stepped.readouts[:2] == shown.readouts[:2]
    assert (shown.rederived, stepped.rederived) == (True, False)


def test_other_integrators_are_shown_as_stepped() -> None:
    shown = run(FREE_JOINT, ENERGY, key=0, integrator=EULER.code)
    assert not shown.rederived
    assert shown.rows == run(FREE_JOINT, ENERGY, key=0, integrator=EULER.code, as_stepped=True).rows


def test_what_a_readout_leaves_in_ctx_is_kept() -> None:
    counted = run(FREE_JOINT, "ctx.count", key=0, setup="ctx.count = 7", controller="ctx.count = ctx.count + 1")
    assert counted.readouts[0] == tuple(float(7 + i) for i in range(STEPS + 1))


@pytest.mark.parametrize("name", sorted(ALL))
@pytest.mark.parametrize("integrator", [RK4, IMPLICITFAST], ids=lambda one: one.name)
@pytest.mark.parametrize("controller", [None, "data.qvel[0] += 0.01 * Math.sin(ctx.n++)"], ids=["free", "driven"])
def test_steps_alone_are_bitwise_those_between_which_something_may_happen(
    name: str, integrator: Integrator, controller: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    xml = ALL[name]
    readouts = [{"label": expr, "expr": expr} for expr in ("data.qvel[0]", ENERGY, "data.xpos[0]", "data.qpos[99]")]
    raw = {"xml": xml, "readouts": readouts, "setup": f"ctx.n = 0; {PUSH}"} | (
        {"controller": controller} if controller else {}
    )
    variant = Variant(integrator=integrator.code, every_step=True, probes=4)
    seconds = STEPS * float(mujoco.MjModel.from_xml_string(xml).opt.timestep)
    alone = run_lab(LabConfig.model_validate(raw), xml, seconds=seconds, variant=variant)
    monkeypatch.setattr(LabSimulation, "_needs_steps_alone", lambda _: False)
    among = run_lab(LabConfig.model_validate(raw), xml, seconds=seconds, variant=variant)
    assert alone.times == among.times
    assert repr(alone.rows) == repr(among.rows)
    assert [probe.rates.tobytes() for probe in alone.probes] == [probe.rates.tobytes() for probe in among.probes]
    assert (alone.warnings, alone.failed.keys()) == (among.warnings, among.failed.keys())
    assert (alone.rederived, alone.duration_s, alone.steps) == (among.rederived, among.duration_s, among.steps)
