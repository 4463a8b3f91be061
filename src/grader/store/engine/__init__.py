"""The database itself: transactions, bulk writes, signals and migrations. It knows no table, and serves SQLite and
PostgreSQL alike."""
