"""Routes of other services: results, rosters, platforms, webhooks, answers on behalf of a learner. Services call them
with tokens that are restricted to scopes; instructors manage platforms and webhooks here too."""
