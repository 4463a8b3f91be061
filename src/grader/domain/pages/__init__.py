"""What pages show of authors' content: texts, formulas, files, and the shapes of pictures."""
