"""Communicates with learning platforms: LTI 1.3, and the deliveries of scores and webhooks. It knows no web framework:
`web` and `api` hand it parsed requests."""
