"""The pages: HTML for learners and instructors, rendered on the server. Pages work without JavaScript; scripts send
forms in the background and draw what moves."""
