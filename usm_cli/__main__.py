"""Runs the `usm` command as `python -m usm_cli`."""

from usm_cli.main import main

if __name__ == "__main__":
    main()
