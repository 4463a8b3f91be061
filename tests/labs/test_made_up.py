"""Forty labs run to their ends; twenty of them agree with the official WASM build of MuJoCo under Node.

The build is pinned to 3.14.0. No compared lab turns a free or ball joint by RK4, so that they agree with 4.0.0 too.
"""

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grader.domain import lab as parts
from grader.domain.lab import LabConfig
from grader.errors import Fault
from grader.labs import LabRun, check_lab, run_lab
from grader.library.checking.mjcf import flatten
from labs.made_up import FINGER, LABS, MadeUp

ROOT = Path(__file__).parents[2]
INSTALLED = ROOT / "build/wasm"
AGREEMENT = 1e-9
"""The largest difference, absolute or relative: nothing here is chaotic within its run."""

COMPARED = [lab for lab in LABS if lab.wasm]


def config_of(lab: MadeUp) -> LabConfig:
    return LabConfig.model_validate_json(json.dumps({"model": "made-up", **lab.config}), strict=True)


def xml_of(lab: MadeUp) -> str:
    whole = flatten(lab.xml, "models/hand.xml", {"models/finger.xml": FINGER}.__getitem__)
    assert isinstance(whole, str), whole
    return whole


def run_of(lab: MadeUp) -> LabRun:
    return run_lab(config_of(lab), xml_of(lab), lab.controls, lab.events)


def keys_of(value: Any) -> Iterator[str]:
    """Every key of a config, at any depth."""
    for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from keys_of(item)
    yield from value if isinstance(value, dict) else ()


def test_there_are_forty_and_together_they_say_everything() -> None:
    assert len({lab.name for lab in LABS}) == len(LABS) == 40
    assert len(COMPARED) >= 20
    classes = (parts.LabConfig, parts.Slider, parts.Select, parts.Button, parts.Readout, parts.Plot, parts.PlotTrace)
    known = {name for part in classes for name in part.model_fields} - {"model", "xml"}
    assert known <= {key for lab in LABS for key in keys_of(lab.config)}
    text = json.dumps([lab.config for lab in LABS])
    for name in ("bodyId", "jointId", "massMatrix", "jacobian", "jacobianSV", "contactPairs", "sim.play", "ctx['q' +"):
        assert name in text, name


@pytest.mark.parametrize("lab", LABS, ids=lambda lab: lab.name)
def test_a_lab_has_no_fault_and_runs_to_its_end(lab: MadeUp) -> None:
    config = config_of(lab)
    assert check_lab(config, xml_of(lab), "lab") == []
    run = run_of(lab)
    shown = run.to_json()
    ended = isinstance(config.stopAt, str)
    assert ended or shown["duration"] == pytest.approx(shown["seconds"])
    assert run.stable
    assert not any(run.always_failed(index) for index in range(len(run.rows[0])))
    assert len(json.dumps(shown, allow_nan=False)) > 100


@pytest.fixture(scope="module")
def in_wasm() -> dict[str, list[list[Any]]]:
    """The readouts of the compared labs in the WASM build, by lab, at the frames of our own run."""
    assert shutil.which("node"), "node is missing: `make test` installs it"
    assert (INSTALLED / "node_modules/@mujoco/mujoco").is_dir(), "the WASM build of MuJoCo is missing: run `make wasm`"
    asked = []
    for lab in COMPARED:
        run, config = run_of(lab), config_of(lab)
        h = run.duration_s / run.steps
        presses = [(round(at / h), label) for at, label in lab.events]
        steps = [round(time / h) for time in run.times]
        plain = json.loads(config.model_dump_json(exclude_unset=True))
        asked.append(
            {"xml": xml_of(lab), "config": plain, "controls": run.controls, "presses": presses, "steps": steps}
        )
    script = Path(__file__).with_name("wasm") / "run.mjs"
    done = subprocess.run(
        ["node", str(script), str(INSTALLED)],
        check=False,
        input=json.dumps(asked),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return dict(zip([lab.name for lab in COMPARED], json.loads(done.stdout), strict=True))


@pytest.mark.process
@pytest.mark.parametrize("lab", COMPARED, ids=lambda lab: lab.name)
def test_a_lab_agrees_with_the_wasm_build(lab: MadeUp, in_wasm: dict[str, list[list[Any]]]) -> None:
    ours, theirs = run_of(lab).rows, in_wasm[lab.name]
    np.testing.assert_allclose(np.array(ours, float), np.array(theirs, float), rtol=AGREEMENT, atol=AGREEMENT)
    assert np.ptp(np.array(ours, float), axis=0).max() > 1e-3, "nothing moved: the comparison would say nothing"


def test_an_attached_file_that_is_missing_is_a_fault() -> None:
    def missing(name: str) -> Fault:
        return Fault(name, "path", "is not a file of the content folder")

    (lab,) = (lab for lab in LABS if lab.name == "attached fingers")
    faults = flatten(lab.xml, "models/hand.xml", missing)
    assert isinstance(faults, list)
    assert [fault.why for fault in faults] == ["attaches 'finger.xml', which is not a file of the content folder"]
