"""A grading process: judges scripts in its jail until its parent ends. It knows no database. It ends when its standard
input does, so that none outlives the server or worker that started it, however that ended."""

import gc
import os
import re
import resource
import shutil
import signal
import sys
import threading
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import structlog

from grader.errors import JailFault, JailRefused, ScriptStopped
from grader.exercises import list_codes, use_jail
from grader.grading.pipeline import Pipeline
from grader.grading.processes import END_S, ScriptJob, ScriptProgress, Stop
from grader.library import Library
from grader.logs import log_to_stderr
from grader.sandbox.jail import Jail

BLOCK_BYTES = 4096

JUDGING_BYTES_MAX = 2 << 30
"""Most memory that judging one script may add to a grading process: results that take more are `out_of_memory`.

Source: the exercises of the lesson add 0.06 to 0.17 GB, nearly all of it reserved for simulations that are kept and
never touched; later scripts add little. So the limit follows what the process holds.
"""

SWITCH_S = 0.0005
"""As in the server: a script waits for its inputs while another thread compiles the models that judging needs [s]."""

PARENT_ENDED = (EOFError, ConnectionResetError)
"""What reading from the parent raises once it has ended; a reset where it had not read all."""

log = structlog.get_logger()


def serve_scripts(connection: "Connection[Any, Any]", jail: Jail) -> None:
    """Answers each script with its verdict, or with the error that says what ended it, until the parent ends."""
    pipeline: Pipeline | None = None

    def is_stopped() -> bool:
        try:
            return connection.poll() and connection.recv() == Stop(message.name)
        except PARENT_ENDED:
            return True

    while True:
        try:
            message = connection.recv()
        except PARENT_ENDED:
            return
        if isinstance(message, Stop):  # its script has ended
            continue
        if isinstance(message, Library):
            pipeline = Pipeline(message, lambda job: jail.run(replace(job, is_stopped=is_stopped)))
            continue
        assert pipeline is not None and isinstance(message, ScriptJob)
        limit_memory()
        try:
            parsed = pipeline.read(message.quiz, message.question, message.answer, message.seed)
            connection.send(pipeline.judge(parsed, lambda *at: connection.send(ScriptProgress(*at))))
        except ScriptStopped as stopped:
            connection.send(stopped)
        except Exception as error:
            log.exception("grading failed", quiz=message.quiz, question=message.question)
            connection.send(JailFault(f"grading failed: {type(error).__name__}"))


def limit_memory() -> None:
    """Limits what the next script may add to this process's memory. The soft limit alone: processes of the jail inherit
    it, and take their own limits up to the hard one."""
    held_kb = re.search(r"^VmData:\s*(\d+) kB$", Path("/proc/self/status").read_text(), re.M)
    assert held_kb is not None
    soft, hard = 1024 * int(held_kb[1]) + JUDGING_BYTES_MAX, resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def end_with_parent(jail: Jail, models: Path) -> None:
    """Ends this process and its jail as soon as the parent's end of standard input is closed. Removes the folder of
    models too: a parent that was killed does not."""
    while os.read(sys.stdin.fileno(), BLOCK_BYTES):  # a buffered reader's lock would be held when the interpreter ends
        pass
    backstop = threading.Timer(END_S / 2, os._exit, (0,))
    backstop.daemon = True
    backstop.start()
    shutil.rmtree(models, ignore_errors=True)
    jail.close()
    os._exit(0)


def main() -> None:
    """Runs one grading process: the socket's number, the folder of models, and perhaps --allow-t2 and --json-log."""
    log_to_stderr(as_json="--json-log" in sys.argv)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # the parent decides when to end
        signal.signal(number, signal.SIG_IGN)
    sys.setswitchinterval(SWITCH_S)
    connection: Connection[Any, Any] = Connection(int(sys.argv[1]))
    try:
        jail = Jail(Path(sys.argv[2]), 1, allow_t2="--allow-t2" in sys.argv, codes=list_codes())
    except JailFault as fault:
        connection.send(JailRefused(str(fault)))
        return
    threading.Thread(target=end_with_parent, args=(jail, Path(sys.argv[2])), daemon=True).start()
    use_jail(jail.run_beside)
    with jail, suppress(BrokenPipeError):
        integrators = f"kept: {jail.keeps_integrators}" if jail.keeps_integrators else "removable"
        gc.freeze()
        gc.enable()
        connection.send({"tier": jail.tier, "self_test": str(jail.self_test), "integrators": integrators})
        serve_scripts(connection, jail)
        shutil.rmtree(sys.argv[2], ignore_errors=True)  # the parent has ended, or does it as well
