"""Reviews by people: claims, marks, rubrics, saved comments, and what reviewers must not know. A review appends a
verdict; earlier ones are kept."""
