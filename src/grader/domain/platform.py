"""Platform: the registration of a learning platform (LTI 1.3); ScoreTarget: where a learner's score goes."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Platform:
    """A platform's registration: one issuer may have several, told apart by their client ids (Canvas). `token_audience`
    is the `aud` of our token requests; empty means the token URL. `origins` are the web origins whose pages may show
    ours in a frame."""

    id: int
    issuer: str
    client_id: str
    login_url: str
    token_url: str
    keys_url: str
    token_audience: str = ""
    origins: tuple[str, ...] = ()


@dataclass(frozen=True)
class ScoreTarget:
    """The place of a learner's score on a platform, as their launch told it. Without `line_item_url` the column is
    looked for, or made, at `line_items_url` by `resource_id`: `QUIZ`, or `QUIZ/QUESTION`. `scopes` are those that the
    launch granted; each URL is empty where the platform named none."""

    platform: Platform
    line_item_url: str
    line_items_url: str
    scopes: tuple[str, ...]
    lti_user_id: str
    deployment_id: str
    resource_link_id: str
    resource_id: str

    @property
    def column(self) -> tuple[str, str]:
        """What two targets have in common whose scores go to the same column."""
        return (self.line_item_url, "") if self.line_item_url else (self.line_items_url, self.resource_id)
