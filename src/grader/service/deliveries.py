"""Assembles the deliveries that the settings describe: webhooks, and scores for learning platforms."""

from collections.abc import Mapping

from grader.grading.content import Archive
from grader.platforms.tool import is_installed
from grader.queue import jobs
from grader.queue.worker import Task
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.outbox import SCORES, WEBHOOK
from grader.store.platforms import score_target


def build_deliveries(settings: Settings, database: Database, archive: Archive) -> Mapping[str, Task]:
    """The task of the topic `deliver`; none where the client for HTTP is not installed."""
    if not is_installed():
        return {}
    from grader.platforms.keys import ToolKeys
    from grader.platforms.sending.access_tokens import AccessTokens
    from grader.platforms.sending.delivering import Delivering
    from grader.platforms.sending.line_items import LineItems
    from grader.platforms.sending.outgoing import Outgoing
    from grader.platforms.sending.scores import Scores
    from grader.platforms.sending.webhooks import Webhooks

    outgoing = Outgoing(settings.private_hosts)
    tokens = AccessTokens(outgoing, ToolKeys(database).sign)
    scores = Scores(archive.current_library, score_target, tokens, LineItems(database, tokens))
    return {jobs.DELIVER: Delivering({WEBHOOK: Webhooks(outgoing), SCORES: scores})}
