"""Pages inside a learning platform: launches, choices, registration. They turn requests of a browser into calls of
`platforms`, and set the cookies and policy of frames."""
