"""Decks in an editor, by the language server that editors use; `tests/run --long` compares the verdicts on all decks."""

import os
import subprocess

import pytest

from conftest import ROOT


def test_the_language_server_knows_decks(program):
    """Needs node and npm, and the network the first time; says why where it cannot be."""
    environment = dict(os.environ, MPM=str(program))
    process = subprocess.run([ROOT / "tests/editor/run"], env=environment, capture_output=True, text=True, timeout=600)
    if process.returncode == 77:
        pytest.skip(process.stdout.strip().removeprefix("skipped: "))
    assert process.returncode == 0, process.stdout + process.stderr
    assert "all as it should be" in process.stdout
