"""Jobs to do, kept in the database: claimed under a lease, taken again when their worker dies."""
