"""Requests to the server. Every refusal becomes one sentence that says what to do."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import httpx

from mjgrader.accounts import Account
from mjgrader.errors import Offline, Refusal, Sentence, SignInAgain

API = "/api/v1"
TIMEOUT_S = 30.0
WAIT_S_MAX = 120.0
"""The longest that a request waits for a busy server, in all."""
BUSY = (429, 503)
OK = 400


@dataclass
class Connection:
    """A server, and who asks. `say` tells the learner what is waited for."""

    account: Account
    say: Callable[[str], None] = print
    transport: httpx.BaseTransport | None = field(default=None, repr=False)

    def get(self, path: str, **options: Any) -> Any:
        """Returns the JSON at a path below the API. Raises Sentence."""
        return read_json(self.request("GET", path, **options))

    def post(self, path: str, body: Mapping[str, Any], **headers: str) -> Any:
        """Sends JSON, and returns what is answered. Raises Sentence."""
        return read_json(self.request("POST", path, json=body, headers=headers))

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        """Sends a request, and waits while the server is busy. Raises Sentence. Redirections are not followed: they
        would carry the token elsewhere."""
        waited = 0.0
        headers = {**options.pop("headers", {}), "Authorization": f"Bearer {self.account.token}"}
        while True:
            response = send(self.account.site, method, API + path, headers, self.transport, **options)
            if response.status_code not in BUSY:
                return check(response, self.account.site)
            pause = read_pause(response)
            if waited + pause > WAIT_S_MAX:
                raise Offline(f"{self.account.site} is busy: try again in {pause:g} s.")
            self.say(f"The server is busy: waiting {pause:g} s.")
            time.sleep(pause)
            waited += pause


def send(
    site: str, method: str, path: str, headers: Mapping[str, str], transport: httpx.BaseTransport | None, **options: Any
) -> httpx.Response:
    """Sends one request. Raises Offline where no answer comes."""
    try:
        with httpx.Client(base_url=site, timeout=TIMEOUT_S, transport=transport) as client:
            return client.request(method, path, headers=dict(headers), **options)
    except httpx.TransportError as error:
        raise Offline(
            f"{site} cannot be reached ({type(error).__name__}): check your connection and the address."
        ) from None


def read_pause(response: httpx.Response) -> float:
    """Returns how long the server asks to wait [s]."""
    try:
        return max(1.0, float(response.headers.get("Retry-After", "5")))
    except ValueError:
        return 5.0


def check(response: httpx.Response, site: str) -> httpx.Response:
    """Returns a response that is no refusal. Raises Sentence."""
    status = response.status_code
    if status < 300 or status == 304:
        return response
    if status < OK:
        raise Refusal(f"{site} answers from {response.headers.get('Location', 'elsewhere')}: sign in there.")
    detail = read_problem(response).get("detail") or f"The server answered {status}."
    if status == 401:
        raise SignInAgain(f'The server does not know your token any more: sign in again with g.sign_in("{site}").')
    if status == 403:
        raise Refusal(f"Your token does not allow this: {detail}")
    if status >= 500:
        raise Offline(f"{site} has a fault of its own ({status}): try again later. {detail}")
    if status == 404 and not is_problem(response):
        raise Refusal(f"{site} is no course server, or an older one: check the address, or ask your instructor.")
    raise Refusal(str(detail))


def is_problem(response: httpx.Response) -> bool:
    """Whether the answer is a problem document (RFC 9457)."""
    return str(response.headers.get("Content-Type", "")).startswith("application/problem+json")


def read_problem(response: httpx.Response) -> Mapping[str, Any]:
    """Returns the members of a problem document; none of anything else."""
    try:
        problem = response.json()
    except ValueError:
        return {}
    return problem if isinstance(problem, dict) else {}


def read_json(response: httpx.Response) -> Any:
    """Returns the JSON of a response. Raises Sentence."""
    try:
        return response.json()
    except ValueError:
        raise Sentence("The answer is not that of a course server: check the address.") from None
