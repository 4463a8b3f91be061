"""Pages that begin and end a browser session. Opening a link changes nothing; only its button, a POST, signs in."""
