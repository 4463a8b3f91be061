"""What a script's text shows, what a sentence on it claims, and whether the claim is true."""
