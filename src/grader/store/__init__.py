"""The database: tables, migrations, and every query in one place."""
