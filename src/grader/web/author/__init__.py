"""The author's desk: a question's source beside the page that a student sees, and what the check says of it."""
