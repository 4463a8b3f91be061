"""Pages of instructors: one module a page. No page needs a script."""
