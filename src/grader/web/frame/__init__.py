"""What every page has: templates, assets, headers, and errors as pages. Templates are rendered here, and files are
served under the digest of their content."""
