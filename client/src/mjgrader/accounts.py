"""Where the token is kept: in the user's configuration folder, readable by the user alone, or in memory."""

import json
import os
import sys
import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path
from urllib.parse import SplitResult, urlsplit

import httpx

from mjgrader.errors import Sentence, SignInAgain

FOLDER = "mjgrader"
LOOPBACK = ("localhost", "127.0.0.1", "::1")
LIKE = "write it like https://grader.example.edu."


@dataclass(frozen=True)
class Account:
    """A server, and the token that it knows. The token does not show in `repr`."""

    site: str
    token: str = field(repr=False)
    course: str | None = None
    user: str | None = None

    @property
    def id(self) -> str:
        """What tells two tokens apart, without the secret."""
        return "_".join(self.token.split("_")[:2])[:40]


def find_folder() -> Path:
    """Returns the folder of configuration: that of the platform, or the one that MJGRADER_CONFIG names."""
    if chosen := os.environ.get("MJGRADER_CONFIG"):
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("APPDATA") or Path.home() / "AppData" / "Roaming", FOLDER)
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / FOLDER
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config", FOLDER)


def read_site(url: str, *, insecure: bool = False) -> str:
    """Returns the origin of an address. Raises Sentence for one that cannot be a server, or would send the token
    readably."""
    try:
        parts = split_address(url if "//" in url else f"https://{url}")
    except (ValueError, httpx.InvalidURL):
        raise Sentence(f"{url!r} is no address of a server: {LIKE}") from None
    if "//" not in url and parts.hostname in LOOPBACK:
        parts = parts._replace(scheme="http")
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise Sentence(f"{url!r} is no address of a server: {LIKE}")
    if parts.scheme == "http" and parts.hostname not in LOOPBACK and not insecure:
        raise Sentence(
            f"http sends your token readably: write https://{parts.netloc}, or add insecure=True in a safe network."
        )
    return f"{parts.scheme}://{parts.netloc}"


def split_address(url: str) -> SplitResult:
    """Returns the parts of an address. Raises ValueError or httpx.InvalidURL for a port or a host that cannot be."""
    parts = urlsplit(url)
    _ = parts.port  # which is read only now
    httpx.URL(f"https://{parts.netloc}").raw_host.decode().encode("idna")  # as asking for the host does
    return parts


def write_private(path: Path, text: str) -> None:
    """Replaces a file by one that the user alone may read, from its first byte on."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent)  # made with mode 0600
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def save_account(account: Account) -> Path:
    """Keeps the account for later processes; returns where."""
    path = find_folder() / "account.json"
    write_private(path, json.dumps(asdict(account)))
    return path


def load_account() -> Account:
    """Returns the account that was kept. Raises SignInAgain."""
    try:
        return Account(**json.loads((find_folder() / "account.json").read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        raise SignInAgain('Sign in first: g.sign_in("https://the-address-of-your-course").') from None


def forget_account() -> None:
    """Deletes the token from this machine."""
    (find_folder() / "account.json").unlink(missing_ok=True)
