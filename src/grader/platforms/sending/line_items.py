"""The line item of a resource at a platform: found by its `resourceId`, or created, by one sender at a time. Source:
LTI Assignment and Grade Services 2.0, section 3.2."""

import json
import re
from collections.abc import Collection
from dataclasses import dataclass
from datetime import timedelta
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qsl, urlencode, urljoin, urlsplit

from grader.domain.platform import ScoreTarget
from grader.platforms.sending.access_tokens import AccessTokens
from grader.platforms.sending.failures import Unreachable
from grader.platforms.sending.outgoing import Response
from grader.platforms.sending.replies import DeadLetter, DeliveryFailure, Later
from grader.store import line_items
from grader.store.engine.database import Database
from grader.store.line_items import LineItemPlace

SCOPE = "https://purl.imsglobal.org/spec/lti-ags/scope/"
LINE_ITEM, READ_LINE_ITEM = f"{SCOPE}lineitem", f"{SCOPE}lineitem.readonly"
SCORE, READ_RESULT = f"{SCOPE}score", f"{SCOPE}result.readonly"

MEDIA = "application/vnd.ims.lis.v2.lineitem+json"
MEDIA_LIST = "application/vnd.ims.lis.v2.lineitemcontainer+json"

PAGES_MAX = 20
"""Pages of line items that are read."""

LEASE = timedelta(minutes=2)
"""How long one sender may take to find or create a line item."""

BUSY_S = 1.0
"""Pause while another sender looks it up [s]."""

NEXT = re.compile(r'<([^>]*)>\s*;[^,]*\brel="?next"?', re.IGNORECASE)


class CallFailed(Exception):
    """A platform answered with an error that the caller classifies."""

    def __init__(self, response: Response) -> None:
        super().__init__(f"{response.status}")
        self.response = response


def add_path(url: str, part: str, **query: str) -> str:
    """Returns a URL with one more path segment, if any, and more query parameters: the ones that it has stay. Moodle
    and others hand out line items such as `.../lineitem?type_id=2`."""
    parts = urlsplit(url)
    path = f"{parts.path.rstrip('/')}/{part}" if part else parts.path
    pairs = [*parse_qsl(parts.query, keep_blank_values=True), *query.items()]
    return parts._replace(path=path, query=urlencode(pairs), fragment="").geturl()


def next_page(response: Response, url: str) -> str | None:
    """Returns the address of the next page after `url`, if the response names one."""
    match = NEXT.search(response.headers.get("link", ""))
    return None if match is None else urljoin(url, match[1])


@dataclass(frozen=True)
class LineItems:
    """Finds and creates line items."""

    database: Database
    tokens: AccessTokens
    lease: timedelta = LEASE

    def place_of(self, target: ScoreTarget) -> LineItemPlace:
        """Returns the row that holds the line item of a target."""
        return LineItemPlace(target.line_items_url, target.resource_id)

    async def url_of(self, target: ScoreTarget, label: str, maximum: float) -> str:
        """Returns the URL of the target's line item. Raises DeliveryFailure, CallFailed, NoToken, RefusedURL and
        Unreachable."""
        if target.line_item_url:
            return target.line_item_url
        if not target.line_items_url or not {LINE_ITEM, READ_LINE_ITEM} & {*target.scopes}:
            raise DeliveryFailure(
                DeadLetter("The platform offers no line item here: it has granted no access to its gradebook.")
            )
        place = self.place_of(target)
        with self.database.write() as session:
            known = line_items.lease(session, place, self.lease)
        if known.url is not None:
            return known.url
        if not known.is_ours:
            raise DeliveryFailure(Later(BUSY_S))
        url = None
        try:
            url = await self._found(target) or await self._created(target, label, maximum)
        finally:
            with self.database.write() as session:
                line_items.keep(session, place, url)
        return url

    def forget(self, target: ScoreTarget) -> None:
        """Forgets the line item of a target, so that the next score looks it up again."""
        with self.database.write() as session:
            line_items.forget(session, self.place_of(target))

    async def _found(self, target: ScoreTarget) -> str | None:
        """Returns the line item with our resource id, if there is one: platforms may ignore the filter."""
        url: str | None = add_path(target.line_items_url, "", resource_id=target.resource_id)
        for _ in range(PAGES_MAX):
            if url is None:
                return None
            response = await self._call(target, "GET", url, {"Accept": MEDIA_LIST})
            listed = response.json()
            for item in listed if isinstance(listed, list) else ():
                if isinstance(item, dict) and item.get("resourceId") == target.resource_id:
                    return read_url(item, url)
            url = next_page(response, url)
        return None

    async def _created(self, target: ScoreTarget, label: str, maximum: float) -> str:
        if LINE_ITEM not in target.scopes:
            raise DeliveryFailure(DeadLetter("The platform has no line item for this, and lets us create none."))
        item: dict[str, Any] = {"label": label, "scoreMaximum": maximum, "resourceId": target.resource_id}
        if target.resource_link_id:
            item["resourceLinkId"] = target.resource_link_id
        url = target.line_items_url
        headers = {"Content-Type": MEDIA, "Accept": MEDIA}
        response = await self._call(target, "POST", url, headers, json.dumps(item).encode())
        return read_url(response.json(), url)

    async def _call(
        self, target: ScoreTarget, method: str, url: str, headers: dict[str, str], body: bytes | None = None
    ) -> Response:
        response = await self.tokens.request(
            target.platform, choose_scopes(target.scopes), method, url, headers=headers, body=body
        )
        if not HTTPStatus.OK <= response.status < HTTPStatus.MULTIPLE_CHOICES:
            raise CallFailed(response)
        return response


def read_url(item: Any, base: str) -> str:
    """Returns the URL of a line item as the platform returned it. Raises Unreachable."""
    url = item.get("id") if isinstance(item, dict) else None
    if not isinstance(url, str) or not url:
        raise Unreachable("The platform's line item has no id.")
    return urljoin(base, url)


def choose_scopes(granted: Collection[str]) -> list[str]:
    """Returns the scopes that sending scores asks for: those that it needs, and of them only the granted ones."""
    needed = [SCORE, READ_RESULT, LINE_ITEM if LINE_ITEM in granted else READ_LINE_ITEM]
    return [scope for scope in needed if scope in granted]
