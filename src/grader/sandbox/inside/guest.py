"""Runs one job in a child that is already locked down: our driver around the student's module.

From the first byte of the student's source on, this process may be under the student's control: what it sends is a
claim. Order: the driver is executed, the student's source imported as a module (never as `__main__`), the driver's
`run(student, inputs, submit)` called. The inputs arrive after the import. The driver finds `hidden_inputs()` among its
names: it asks for the hidden inputs, and what is printed after that is not kept. `exchange(answer)` sends an answer,
unless it is None, and returns the next message of the channel, None at the end of a trial. If it defines
`compile_source(source, filename)`, that compiles the student's source.
"""

import base64
import builtins
import contextlib
import ctypes
import errno
import io
import json
import linecache
import marshal
import os
import random
import re
import resource
import struct
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NoReturn

import numpy as np

from .kernel import libc
from .sampling import Sampler

STDOUT, STDERR, RESULTS, JOB = 1, 2, 3, 4
DTYPES = {"float64": b"d", "float32": b"f", "int64": b"q", "int32": b"i", "uint8": b"B", "bool": b"?"}
KINDS = {"returned": 0, "crashed": 1, "forbidden": 2, "out_of_memory": 3}
REFUSALS = {errno.EPERM, errno.EACCES, errno.ENOSYS, errno.EROFS}
REASON_BYTES_MAX = 2000
PIPE_BYTES = 1 << 16
COURSE = "mjcourse"
FORBIDDEN = "scripts may not start processes, use the network, or reach for files that are not theirs"
PROCESSES = re.compile(r"/(multiprocessing/|concurrent/futures/process|subprocess)")
"""Files of the standard library that start processes."""
LINE_CHARS_MAX = 80
ANSWER = b"C"  # to a message of the channel
WANT = b"W"  # asks for the next part of the job
read_some, write_some = os.read, os.write  # a script may exchange those of `os`
CODES: list[CodeType] = []
"""The code that the zygote has loaded, for the drivers of jobs."""
OWN_FOLDERS: list[str] = []  # set by prepare(): a file missing here is not a refusal of the jail


def prepare(models: str, directory: str) -> None:
    """Add the course's own module, and the names that `site` would have added; called in the zygote."""
    OWN_FOLDERS[:] = [f"{models}/", f"{directory}/"]
    course = ModuleType(COURSE, "The course's helpers: where the lesson's models are.")

    def model_path(name: str) -> Path:
        """Path of a model of the lesson, by its name, e.g. model_path("pendulum")."""
        path = Path(models) / f"{Path(str(name)).name.removesuffix('.xml')}.xml"
        if not path.is_file():
            known = ", ".join(sorted(p.stem for p in Path(models).glob("*.xml")))
            raise FileNotFoundError(f"There is no model {name!r}; the course has: {known}")
        return path

    course.__dict__["model_path"] = model_path
    sys.modules[COURSE] = course
    for name in ("exit", "quit"):
        setattr(builtins, name, sys.exit)
    time.process_time, time.process_time_ns = process_time, process_time_ns


def process_time() -> float:
    """CPU time of this process [s]. While a process has a limit of CPU time, the kernel counts its own clock in ticks
    of milliseconds, so that short work takes 0; what it tells of the resources used is exact."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def process_time_ns() -> int:
    """CPU time of this process [ns]."""
    return round(process_time() * 1e9)


def refuse_callbacks() -> None:
    """Make ctypes refuse a Python function that C could call back, with a sentence: libffi has no memory for it."""
    plain: Any = ctypes._CFuncPtr  # type: ignore[attr-defined]

    class Function(plain):  # type: ignore[misc]
        _flags_ = 1  # FUNCFLAG_CDECL; every subclass sets its own

        def __new__(cls, *values: Any) -> Any:
            if values and callable(values[0]):
                raise PermissionError(errno.EPERM, "ctypes callbacks into Python are not available")
            return super().__new__(cls, *values)

    ctypes._CFuncPtr = Function  # type: ignore[attr-defined]


def reseed() -> None:
    """Give every job the same random state, so that a script that is graded twice does the same."""
    random.seed(0)
    np.random.seed(0)


def say_ready(probed: dict[str, Any]) -> None:
    """Say on the results channel, in one line, that this process is locked down."""
    _write(RESULTS, json.dumps(probed).encode() + b"\n")


def receive() -> dict[str, Any]:
    """Block until the next part of the job has arrived."""
    (size,) = struct.unpack("<I", _read(4))
    part: dict[str, Any] = json.loads(_read(size))
    return part


def _read(size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        chunk = read_some(JOB, min(size - len(data), PIPE_BYTES))
        if not chunk:
            os._exit(0)  # a spare that is no longer needed
        data += chunk
    return bytes(data)


def play(work: dict[str, Any]) -> NoReturn:
    """Run the job, send how it ended, and leave without any of the student's clean-up."""
    leave, write = os._exit, _write
    filename = work["filename"]
    sys.stdout = io.TextIOWrapper(io.FileIO(STDOUT, "w"), "utf-8", "backslashreplace", write_through=True)
    sys.stderr = io.TextIOWrapper(io.FileIO(STDERR, "w"), "utf-8", "backslashreplace", write_through=True)
    kind, reason = "returned", ""
    Sampler(filename, _send_sample).start(work["cpu_s"], work["wall_s"])
    try:
        _run(work, filename)
    except BaseException as error:
        kind, reason = _explain(error, filename)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):  # the student's own stream, and its own loss
            stream.flush()
    libc.fflush(None)
    text = reason.encode("utf-8", "replace")[:REASON_BYTES_MAX]
    write(RESULTS, b"E" + struct.pack("<BH", KINDS[kind], len(text)) + text)
    leave(0)


def submit(name: str, value: Any) -> None:
    """Send one named array of numbers back. Raises TypeError for anything else."""
    array = np.ascontiguousarray(value).reshape(np.shape(value))
    if array.dtype.kind in "iu" and array.dtype.name not in DTYPES:
        array = array.astype(np.int64)
    if array.dtype.name not in DTYPES:
        raise TypeError(f"{name} is not an array of numbers")
    label, payload = name.encode("ascii"), array.tobytes()
    head = b"A" + struct.pack("<B", len(label)) + label + DTYPES[array.dtype.name]
    shape = struct.pack(f"<B{array.ndim}I", array.ndim, *array.shape)
    _write(RESULTS, head + shape + struct.pack("<I", len(payload)) + payload)


def _send_sample(name: str, text: bytes) -> None:
    """Send a sample, unless it would come in the middle of another frame."""
    if not _writing:
        submit(name, np.frombuffer(text, dtype=np.uint8))


def _run(work: dict[str, Any], filename: str) -> None:
    driver: dict[str, Any] = {"__name__": "driver", "__builtins__": builtins}
    codes = {name: CODES[one] if isinstance(one, int) else _load_code(one) for name, one in work["codes"].items()}
    driver.update(kind_of=_find_kind, hidden_inputs=hidden_inputs, exchange=exchange, codes=codes)
    _talks.extend([True] * work["talks"])
    exec(compile(work["driver"], "<driver>", "exec"), driver)  # noqa: S102
    student = _import(work["source"], filename, driver.get("compile_source", _compile))
    driver["run"](student, _request_part(), submit)


def _load_code(text: str) -> CodeType:
    code: CodeType = marshal.loads(base64.b64decode(text))  # noqa: S302 - the grader's own
    return code


def hidden_inputs() -> dict[str, Any]:
    """Ask for the hidden inputs, once; what is printed from here on is not kept."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):  # the student's own stream, and its own loss
            stream.flush()
    libc.fflush(None)
    inputs = _request_part()
    if not _talks:
        os.close(JOB)
    return inputs


def exchange(answer: bytes | None) -> bytes | None:
    """Send an answer over the channel, and block until the next message has arrived; None at the end of a trial."""
    if answer is not None:
        _write(RESULTS, ANSWER + struct.pack("<I", len(answer)) + answer)
    (size,) = struct.unpack("<I", _read(4))
    return _read(size) if size else None


def _request_part() -> dict[str, Any]:
    _write(RESULTS, WANT)
    return receive()


def _compile(source: str, filename: str) -> CodeType:
    code: CodeType = compile(source, filename, "exec", dont_inherit=True)
    return code


def _import(source: str, filename: str, compile_source: Callable[[str, str], CodeType]) -> ModuleType:
    """Run the student's source as a module named for its file, in sys.modules for dataclasses and pickle."""
    name = re.sub(r"\W", "_", Path(filename).stem)
    if name in sys.modules or name in sys.stdlib_module_names or name == "__main__":
        name = "submission"
    module = ModuleType(name)
    module.__file__ = filename
    sys.modules[name] = module
    linecache.cache[filename] = (len(source), None, source.splitlines(True), filename)
    sys.path.insert(0, "")
    with contextlib.suppress(OSError, UnicodeError):  # without a scratch directory it cannot read its own file
        Path(filename).write_text(source, encoding="utf-8")
    exec(compile_source(source, filename), module.__dict__)  # noqa: S102
    return module


def _explain(error: BaseException, filename: str) -> tuple[str, str]:
    """Returns the kind of end, and the last line of a traceback that shows the student's own lines on stderr."""
    kind = _find_kind(error)
    if kind == "out_of_memory":
        traceback.clear_frames(error.__traceback__)
    try:
        shown = traceback.TracebackException.from_exception(error)
        _keep_own_lines(shown, filename, set())
        _write(STDERR, "".join(shown.format()).encode("utf-8", "backslashreplace"))
        notes, shown.__notes__ = shown.__notes__ or (), None
        last = [line for line in shown.format_exception_only() if line.strip()]
        reason = " ".join([last[-1].strip() if last else type(error).__name__, *map(str, notes)])
        place = _describe_place(error, shown.stack)
    except BaseException:
        reason, place = type(error).__name__, ""
    return kind, _describe_error(error, kind, reason, place)


def _describe_place(error: BaseException, own: traceback.StackSummary) -> str:
    """Where in the student's file an error was raised, to end a sentence; of a syntax error the line itself."""
    if isinstance(error, SyntaxError):
        return f" (line {error.lineno}: {(error.text or '').strip()[:LINE_CHARS_MAX]})"
    return f", in line {own[-1].lineno} of your script" if own else ""


def _describe_error(error: BaseException, kind: str, reason: str, place: str) -> str:
    if isinstance(error, SystemExit):
        return "The script called exit() before it was graded."
    if kind == "forbidden" and any(map(PROCESSES.search, _list_files(error))):
        return f"Do without other processes{place}: none can be started here, and one is enough."
    return f"{reason}{place} ({FORBIDDEN})" if kind == "forbidden" else f"{reason}{place}"


def _list_files(error: BaseException) -> Iterator[str]:
    step = error.__traceback__
    while step is not None:
        yield step.tb_frame.f_code.co_filename
        step = step.tb_next


def _find_kind(error: BaseException) -> str:
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return "out_of_memory"
    if type(error).__name__ in ("FatalError", "ValueError") and "ould not allocate memory" in str(error):
        return "out_of_memory"  # MuJoCo's own words
    if isinstance(error, OSError) and any(map(_is_refusal, _list_causes(error))):
        return "forbidden"
    return "crashed"


def _is_refusal(error: BaseException) -> bool:
    """Tell whether the jail refused something; a file outside what a script may read is refused by being absent."""
    if not isinstance(error, OSError):
        return False
    if error.errno == errno.ENOENT:
        if not isinstance(error.filename, str):
            return True  # not a file: semaphores or shared memory
        path = os.path.abspath(error.filename)  # noqa: PTH100 - resolve() would ask the disk
        return not path.startswith(tuple(OWN_FOLDERS))
    return error.errno in REFUSALS or type(error).__name__ == "gaierror"


def _list_causes(error: BaseException | None) -> Iterator[BaseException]:
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__


def _keep_own_lines(shown: traceback.TracebackException, filename: str, seen: set[int]) -> None:
    """Keep the frames of the student's file, in the exception and in those it came from."""
    if id(shown) in seen:
        return
    seen.add(id(shown))
    shown.stack = traceback.StackSummary.from_list([f for f in shown.stack if f.filename == filename])
    for other in (shown.__cause__, shown.__context__, *(shown.exceptions or ())):
        if other is not None:
            _keep_own_lines(other, filename, seen)


_talks: list[bool] = []
"""Not empty if the job has a channel."""
_writing: list[int] = []
"""The descriptors that are being written to."""


def _write(descriptor: int, data: bytes) -> None:
    view = memoryview(data)
    _writing.append(descriptor)
    try:
        while view:
            view = view[write_some(descriptor, view) :]
    finally:
        _writing.pop()
