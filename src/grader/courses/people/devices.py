"""Devices: a program on a member's own machine gets a token by the device flow, RFC 8628. It shows a short code, which
the member confirms on a page; meanwhile it asks again and again."""

import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import CredentialKind, Identity, Role, Scope, issue, visible_part
from grader.courses.people.members import require_credential
from grader.errors import Conflict, NotFound
from grader.store import credentials, people, tickets
from grader.store.tables import NAME, Credential, now

DEVICE, USER_CODE = "device", "user code"
"""The purposes of the two tickets of a request: the device's own secret, and the code that its owner reads."""

CODE = timedelta(minutes=10)
TOKEN = timedelta(days=30)
SCOPES = frozenset({Scope.ANSWER, Scope.READ})
"""A device hands in for its owner, and reads the questions and the owner's verdicts."""

INTERVAL_S = 5
"""The least time between two questions of a device [s], and what each hasty one adds. Source: RFC 8628, 3.5."""

LETTERS = "BCDFGHJKLMNPQRSTVWXZ"
LENGTH = 8
"""A user code has 34 bits, spells no word, and has no letter that looks like another. Source: RFC 8628, 6.1."""

DEVICES_MAX = 20
"""The tokens that a member may have before one has to be revoked."""

UNKNOWN = "This code is unknown, has been used, or is older than ten minutes. Start again on your device."


@dataclass(frozen=True)
class NewDevice:
    """The codes of a request that has begun: the device's own, and the one that it shows."""

    device_code: str
    user_code: str


@dataclass(frozen=True)
class WaitingDevice:
    """A request that its owner may confirm."""

    user_code: str
    label: str


@dataclass(frozen=True)
class DeviceToken:
    """The token of a device that was allowed, shown this once, and who gave it."""

    token: str
    user: str
    course: str


@dataclass(frozen=True)
class Refusal:
    """Why a device gets no token now: an error code of RFC 8628, 3.5, and what it means."""

    error: str
    why: str


PENDING = Refusal("authorization_pending", "Nobody has confirmed the code yet: ask again.")
SLOW_DOWN = Refusal("slow_down", f"Ask {INTERVAL_S} seconds less often from now on.")
DENIED = Refusal("access_denied", "The code was refused: start again.")
EXPIRED = Refusal("expired_token", "The code is unknown, has been used, or is too old: start again.")


def begin(session: Session, label: str) -> NewDevice:
    """Begins the request of a device that calls itself `label`."""
    label = visible_part(label).strip()[:NAME] or "A program"
    letters = "".join(secrets.choice(LETTERS) for _ in range(LENGTH))
    device_code = tickets.issue(session, DEVICE, {"label": label, "interval_s": INTERVAL_S}, CODE)
    device = {"device": tickets.hash_secret(device_code), "label": label}
    tickets.issue(session, USER_CODE, device, CODE, letters)
    return NewDevice(device_code, spell(letters))


def spell(letters: str) -> str:
    """Returns a user code as it is shown: in two halves."""
    return f"{letters[: LENGTH // 2]}-{letters[LENGTH // 2 :]}"


def read_code(typed: str) -> str:
    """Returns the letters of a user code as somebody types it: in any case, with any separators."""
    return re.sub("[^A-Z]", "", typed[:NAME].upper())


def find_waiting(session: Session, typed: str) -> WaitingDevice | None:
    """Returns the request behind a user code; None if it is unknown, used or too old."""
    letters = read_code(typed)
    body = tickets.peek(session, USER_CODE, letters)
    return None if body is None else WaitingDevice(spell(letters), body["label"])


def decide(session: Session, who: Identity, typed: str, *, allowed: bool) -> None:
    """Allows a device a token of the member, or refuses it; its code is used. Raises NotFound, Conflict, Forbidden,
    Unauthorized."""
    who.require(Role.STUDENT, Role.INSTRUCTOR)
    require_credential(session, who)
    if allowed and len(list_devices(session, who)) >= DEVICES_MAX:
        raise Conflict(f"You have {DEVICES_MAX} devices: revoke one that you do not use any more, then start again.")
    body = tickets.take(session, USER_CODE, read_code(typed))
    decided = {"member": who.id if allowed else None, "course": who.course, "role": who.role}
    if body is None or not tickets.change(session, DEVICE, body["device"], **decided):
        raise NotFound(UNKNOWN)
    if allowed:
        record(session, who, who.course, Action.DEVICE_ALLOWED, who.user, device=body["label"])


def ask(session: Session, device_code: str) -> DeviceToken | Refusal:
    """Answers a device that asks for its token. It gets one once, if its owner has allowed it and
    still has the same role."""
    body = tickets.peek(session, DEVICE, device_code)
    if body is None:
        return EXPIRED
    if "member" not in body:
        return _wait(session, device_code, body)
    if tickets.take(session, DEVICE, device_code) is None:
        return EXPIRED
    member = None if body["member"] is None else people.get(session, body["member"], body["course"])
    if member is None or member.role != body["role"]:
        return DENIED
    token = issue(session, CredentialKind.TOKEN, member, TOKEN, scopes=SCOPES, label=body["label"])
    return DeviceToken(token, member.name, member.course)


def _wait(session: Session, device_code: str, body: dict[str, Any]) -> Refusal:
    last = body.get("asked_at")
    is_hasty = last is not None and now() - datetime.fromisoformat(last) < timedelta(seconds=body["interval_s"])
    interval_s = body["interval_s"] + (INTERVAL_S if is_hasty else 0)
    state = {"asked_at": now().isoformat(), "interval_s": interval_s}
    tickets.change(session, DEVICE, tickets.hash_secret(device_code), **state)
    return SLOW_DOWN if is_hasty else PENDING


def list_devices(session: Session, who: Identity) -> Sequence[Credential]:
    """Returns the tokens of a member that are valid, newest first."""
    return credentials.list_alive_of(session, who.id, CredentialKind.TOKEN, now())


def revoke_device(session: Session, who: Identity, token_id: str) -> None:
    """Revokes a token of one's own. Raises NotFound."""
    credential = credentials.find(session, token_id, CredentialKind.TOKEN, now())
    if credential is None or credential.member != who.id:
        raise NotFound("You have no such device.")
    credentials.revoke(session, credential.id, now())
    record(session, who, who.course, Action.TOKEN_REVOKED, who.user, token=token_id)
