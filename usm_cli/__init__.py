"""The `usm` command."""
