"""A queue of jobs in the database, and the owners of the jobs in progress. One table serves SQLite and PostgreSQL. They
differ in two things only: how the end of an owner is noticed (`owners`), and how news travels (`store.signals`)."""
