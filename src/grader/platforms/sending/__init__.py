"""From this tool to others: scores to platforms, and webhooks. Deliveries are read from the outbox, sent, and tried
again when they fail."""
