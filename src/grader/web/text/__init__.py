"""Text on pages: numbers, statuses, questions, and authors' prose made safe. Authors' HTML passes through `prose`
before it reaches a page."""
