"""The people of a course: members, their roles, credentials and rosters, and the audit log of what was done. A member
is identified by an id; the name is a label."""
