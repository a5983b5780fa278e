"""What `--help` says of a command."""

import subprocess
import sys
from pathlib import Path
from pkgutil import iter_modules

import pytest

from usm_cli import commands
from usm_cli.program import main

USM = Path(sys.executable).with_name("usm")


@pytest.mark.parametrize("command", [[USM], [USM, "evaluate"], [sys.executable, "-m", "usm_cli"]])
def test_help_teaches(command):
    answer = subprocess.run([*command, "--help"], capture_output=True, text=True, check=False)
    assert answer.returncode == 0
    assert "usage: usm" in answer.stdout


@pytest.mark.parametrize("columns", [80, 140])
@pytest.mark.parametrize("command", [module.name for module in iter_modules(commands.__path__)])
def test_help_fits_the_terminal(command, columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(columns))
    main([command, "--help"])
    said = capsys.readouterr().out.splitlines()
    assert 0.7 * columns < max(map(len, said)) <= columns
