"""Signing in with a code that the learner confirms in a browser (RFC 8628)."""

import platform
import time
from collections.abc import Callable, Mapping
from typing import Any

import httpx

from mjgrader.accounts import Account
from mjgrader.connection import API, check, read_json, read_problem, send
from mjgrader.errors import Refusal, Sentence

SLOWER_S = 5.0
"""How much longer to wait after `slow_down`. Source: RFC 8628, section 3.5."""

ENDS = {
    "expired_token": "The code has expired: sign in again for a new one.",
    "access_denied": "The sign-in was refused on the page. No token was made.",
}


def ask_for_code(site: str, transport: httpx.BaseTransport | None = None) -> Mapping[str, Any]:
    """Returns the server's codes, where to confirm them and how often to ask. Raises Sentence."""
    body = {"client_name": f"mjgrader on {platform.node() or 'a notebook'}"[:80]}
    response = send(site, "POST", f"{API}/devices", {}, transport, json=body)
    if response.status_code in (401, 404, 405):
        raise Refusal(
            f"{site} has no sign-in by code: ask your instructor for a token, "
            f'and call g.sign_in("{site}", token=getpass.getpass()).'
        )
    codes: Mapping[str, Any] = read_json(check(response, site))
    return codes


def read_account(site: str, made: Mapping[str, Any]) -> Account:
    """Returns the account of a new token. Raises Sentence where there is none."""
    token = made.get("access_token")
    if not isinstance(token, str):
        raise Sentence("The server confirmed the code and sent no token: upgrade this client.")
    return Account(site, token, made.get("course"), made.get("user"))


def wait_for_token(
    site: str, codes: Mapping[str, Any], say: Callable[[str], None], transport: httpx.BaseTransport | None = None
) -> Account:
    """Asks until the code is confirmed. Raises Sentence where it is refused or expires."""
    pause, left = float(codes.get("interval", 5)), float(codes["expires_in"])
    while left > 0:
        time.sleep(pause)
        left -= pause
        response = send(site, "POST", f"{API}/devices:token", {}, transport, json={"device_code": codes["device_code"]})
        if response.status_code == 200:
            return read_account(site, read_json(response))
        problem = read_problem(response)
        why = problem.get("error")
        if why in ENDS:
            raise Sentence(ENDS[why])
        if why == "slow_down" or response.status_code == 429:
            pause += SLOWER_S
            say(f"Asking less often: every {pause:g} s.")
        elif why != "authorization_pending":
            check(response, site)
            raise Sentence("The server answered the sign-in in a way that this client does not know: upgrade it.")
    raise Sentence(ENDS["expired_token"])
