"""Assembles the deliveries that the settings describe: webhooks, and scores for learning platforms."""

from collections.abc import Mapping

from grader.content import Archive
from grader.lms.tool import is_installed
from grader.queue import jobs
from grader.queue.worker import Task
from grader.settings import Settings
from grader.store.database import Database
from grader.store.outbox import SCORES, WEBHOOK
from grader.store.platforms import score_target


def deliveries_of(settings: Settings, database: Database, archive: Archive) -> Mapping[str, Task]:
    """The task of the topic `deliver`; none where the client for HTTP is not installed."""
    if not is_installed():
        return {}
    from grader.lms.access_tokens import AccessTokens
    from grader.lms.delivering import Delivering
    from grader.lms.keys import ToolKeys
    from grader.lms.line_items import LineItems
    from grader.lms.outgoing import Outgoing
    from grader.lms.scores import Scores
    from grader.lms.webhooks import Webhooks

    outgoing = Outgoing(settings.private_hosts)
    tokens = AccessTokens(outgoing, ToolKeys(database).sign)
    scores = Scores(archive.library_now, score_target, tokens, LineItems(database, tokens))
    return {jobs.DELIVER: Delivering({WEBHOOK: Webhooks(outgoing), SCORES: scores})}
