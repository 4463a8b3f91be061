"""From this tool to others: scores to platforms, and webhooks. Failed deliveries are tried again."""
