"""`python -m grader`, the command line where its program is not on the path."""

from grader.commands.main import main

if __name__ == "__main__":
    main()
