"""Coverage-guided fuzzing of the parser of results; not part of the suite, as atheris is not a dependency.

pip install atheris
PYTHONPATH=src python tests/sandbox/fuzz_frames.py -max_total_time=300 -max_len=4096 -rss_limit_mb=512
"""

import sys

import atheris  # type: ignore[import-not-found, import-untyped, unused-ignore]

with atheris.instrument_imports(include=["grader.sandbox.frames"]):
    from grader.sandbox.frames import DTYPES, KINDS, MalformedMessage, parse_message
    from grader.sandbox.policy import NAME_CHARS_MAX, NDIM_MAX

import numpy as np


def one_input(data: bytes) -> None:
    try:
        message = parse_message(data)
    except MalformedMessage:
        return
    assert message.end is None or message.end in KINDS
    for name, array in message.results.items():
        assert name.isidentifier() and len(name) <= NAME_CHARS_MAX and array.ndim <= NDIM_MAX
        assert array.dtype.str in DTYPES.values()
        assert array.dtype.kind != "f" or np.isfinite(array).all()
        assert array.nbytes <= len(data)


if __name__ == "__main__":
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
