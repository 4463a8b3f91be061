"""What instructors decide on and write to answers: reviews and claims, saved comments, comments on lines."""
