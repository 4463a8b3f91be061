"""What the pages take from others is built from what stands in deploy/vendor, and says whose it is."""

import hashlib
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "deploy" / "vendor"
BUNDLES = ROOT / "src/grader/web/static/vendor"
ENTRIES = sorted(SOURCES.glob("*.entry.js"))


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda path: path.name)
def test_a_bundle_is_of_its_lock_and_its_entry(entry: Path) -> None:
    parts = [SOURCES / "package-lock.json", SOURCES / "build.mjs", entry]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in parts)).hexdigest()
    name = entry.name.removesuffix(".entry.js")
    first = (BUNDLES / f"{name}.js").read_text().partition("\n")[0]
    assert first == f"// Made by make vendor of {digest}; licences in {name}.LICENSES.txt"


def test_every_bundle_has_an_entry_and_licences() -> None:
    names = {path.name.removesuffix(".entry.js") for path in ENTRIES}
    assert {path.name for path in BUNDLES.iterdir()} == {f"{n}{end}" for n in names for end in (".js", ".LICENSES.txt")}
    assert "Permission is hereby granted" in (BUNDLES / "codemirror.LICENSES.txt").read_text()


def test_the_lock_pins_digests_and_names_no_address() -> None:
    text = (SOURCES / "package-lock.json").read_text()
    assert "resolved" not in text and "://" not in text
    packages = json.loads(text)["packages"]
    assert all("integrity" in one for path, one in packages.items() if path)
