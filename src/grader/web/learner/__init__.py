"""Pages of learners: lessons, exercises, and forms that hand in. They hand in as the API does, and show what the policy
allows."""
