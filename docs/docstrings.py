"""Takes docstrings from Python where a class completes its own on import."""

import importlib
import inspect

import griffe


class RuntimeDocstrings(griffe.Extension):
    """Takes docstrings with a table of the observation from the classes themselves."""

    def on_class(self, *, cls, **_):
        """Replace such a docstring, whose headings come one level below that of the class."""
        if cls.docstring and "OBSERVATION_TABLE" in cls.docstring.value:
            runtime = getattr(importlib.import_module(cls.module.path), cls.name)
            cls.docstring.value = inspect.getdoc(runtime).replace("\n## ", "\n# ")
