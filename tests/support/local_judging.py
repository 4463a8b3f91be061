"""Judges every visible trial a second time, as the client does, whenever a test judges a script."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from grader.exercises import load_kinds
from grader.exercises.judgement import Judgement
from grader.exercises.running import trials
from mjgrader.judges import JUDGES

JUDGED = {"trials": 0}
"""How many trials were judged twice."""


@contextmanager
def judging_twice() -> Iterator[None]:
    """Raises AssertionError where the client's judgement on a visible trial is not the server's. The client gets what
    the kit would have, through JSON."""
    judge_trial = trials.judge_trial
    names = {id(kind): name for name, kind in load_kinds().items()}

    def judge_both(kind: Any, plan: Any, trial: Any, results: Any, run: Any) -> tuple[Judgement[Any], Any]:
        ours, status = judge_trial(kind, plan, trial, results, run)
        name = names.get(id(kind), "")
        if status is None and not trial.hidden and name in JUDGES:
            described = kind.describe_problem("value", plan.parameters, trial)
            if described is not None:
                inputs, problem = json.loads(json.dumps([kind.describe_inputs(trial), described], allow_nan=False))
                with np.errstate(all="ignore"):
                    theirs = JUDGES[name](inputs, problem, results)
                same = ("passed", "message", "detail", "needs", "unmet")
                assert {one: getattr(ours, one) for one in same} == {one: getattr(theirs, one) for one in same}
                JUDGED["trials"] += 1
        return ours, status

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trials, "judge_trial", judge_both)
        yield
