"""The pages: HTML for learners and instructors, drawn on the server; they talk to the API by fetch."""
