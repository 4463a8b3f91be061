"""The pages: HTML for learners and instructors, rendered on the server, and the browser sessions."""
