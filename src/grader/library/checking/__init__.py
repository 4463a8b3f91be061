"""What is wrong with content as it stands in the files: faults that refuse it, and remarks to its author."""
