"""The outbox of changed results, and the webhooks of a course. A row is put into the outbox in the transaction of the
change; `platforms.sending` delivers it."""
