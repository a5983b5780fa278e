"""`python -m usm_cli` is the `usm` command."""

from usm_cli.main import main

if __name__ == "__main__":
    main()
