"""From records to summaries, tables and pictures; nothing here measures."""
