"""Browser sessions as cookies."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from sqlalchemy.orm import Session

from grader.courses.people.identity import COOKIE, SECURE_COOKIE
from grader.courses.people.sign_in import BrowserSession, end_session
from grader.store.engine.database import Database

Result = TypeVar("Result")


@dataclass(frozen=True)
class SessionCookies:
    """Finds and ends browser sessions, and writes their cookies. `secure` adds the attributes that https allows;
    `anonymous` says whether anyone may begin a session."""

    database: Database
    secure: bool
    anonymous: bool

    def set_cookie(self, opened: BrowserSession, *, framed: bool = False) -> str:
        """The `Set-Cookie` header that starts a session in the browser; the cookie lives as long as the session.
        `framed` is for a page in the frame of another site: see `attributes`."""
        return self._header(opened.secret, int(opened.lifetime.total_seconds()), framed=framed)

    def delete_cookie(self, *, framed: bool = False) -> str:
        """The `Set-Cookie` header that makes the browser forget its session."""
        return self._header("", 0, framed=framed)

    def attributes(self, max_age_s: int, *, framed: bool) -> str:
        """The attributes of a cookie. One for a frame is kept for the embedding site alone: partitioned. Without https
        browsers take no such cookie; on loopback, sites on all ports count as one."""
        site = "None; Secure; Partitioned" if framed and self.secure else "Lax; Secure" if self.secure else "Lax"
        return f"Max-Age={max_age_s}; Path=/; HttpOnly; SameSite={site}"

    def reading(self, query: Callable[[Session], Result]) -> Result:
        """Calls `query` in a transaction for reading."""
        with self.database.read() as session:
            return query(session)

    def writing(self, change: Callable[[Session], Result]) -> Result:
        """Calls `change` in a transaction for writing."""
        with self.database.write() as session:
            return change(session)

    def end(self, cookies: Mapping[str, str]) -> None:
        """Ends the browser's session."""
        with self.database.write() as session:
            self.end_in(session, cookies)

    def end_in(self, session: Session, cookies: Mapping[str, str]) -> None:
        """As `end`, in a transaction that is under way."""
        for name in (SECURE_COOKIE, COOKIE):
            end_session(session, cookies.get(name, ""))

    def _header(self, value: str, max_age_s: int, *, framed: bool) -> str:
        name = SECURE_COOKIE if self.secure else COOKIE
        return f"{name}={value}; {self.attributes(max_age_s, framed=framed)}"
