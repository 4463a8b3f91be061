"""The database: tables, migrations, and every query in one place, one module a subject. Other rooms call these
functions inside a transaction; only the queue has queries of its own."""
