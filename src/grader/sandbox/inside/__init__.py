"""What runs inside the cell: trusted up to the first byte of the student's source, and importing nothing of ours."""
