"""`python -m agents` is the `usm` command."""

from agents.main import main

if __name__ == "__main__":
    main()
