"""`mjgrade`: what it reads, and that each mistake ends with one sentence and exit status 2."""

import importlib.util
from pathlib import Path

from mjgrader.command import read_script
from mjgrader.sources import read_source

BOM = b"\xef\xbb\xbf"


def test_a_script_of_windows_notepad_is_read_without_its_byte_order_mark(tmp_path: Path) -> None:
    script = tmp_path / "swing.py"
    script.write_bytes(BOM + b"def swing():\n    return 1\n")
    assert read_script(script) == "def swing():\n    return 1\n"
    assert read_script(script, "mjcf") == "def swing():\n    return 1\n"
    spec = importlib.util.spec_from_file_location("swing", script)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert read_source(module.swing, "swing") == "def swing():\n    return 1\n"
