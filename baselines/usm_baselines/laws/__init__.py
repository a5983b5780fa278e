"""Control laws, one in a file."""
