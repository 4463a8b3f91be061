"""The notes of a release: its section of CHANGELOG.md, and its files with their digests."""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path

from release.building import ROOT, ReleaseError


def read_changes(version: str) -> str:
    """Returns the section of a version in CHANGELOG.md. Raises ReleaseError where it is missing, empty or undated."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    section = re.search(
        rf"^## {re.escape(version)} - \d{{4}}-\d\d-\d\d\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL
    )
    if section is None or not section[1].strip():
        raise ReleaseError(f"CHANGELOG.md: has no section `## {version} - YYYY-MM-DD`: write it")
    return section[1].strip()


def write_notes(version: str, files: Sequence[Path], checks: Sequence[str], folder: Path) -> None:
    """Writes NOTES.md and SHA256SUMS beside the files of a release. Raises ReleaseError without a changelog."""
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" for path in files]
    (folder / "SHA256SUMS").write_text("\n".join(sums) + "\n")
    parts = [f"# {version}", read_changes(version), "## How this release was checked"]
    parts += ["\n".join(f"- {line}" for line in checks), "## Files", "```text\n" + "\n".join(sums) + "\n```"]
    (folder / "NOTES.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
