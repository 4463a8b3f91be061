"""Grades submissions, from answer to verdict. It keeps the content that is loaded and every earlier one, runs scripts
in processes of their own, and checks content folders."""
