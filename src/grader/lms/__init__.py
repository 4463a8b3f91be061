"""Speaks with learning platforms: LTI 1.3, and the deliveries of scores and webhooks."""
