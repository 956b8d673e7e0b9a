"""What the tests share. They need the package installed: `make python-test` does that in an
environment of its own."""

import os
import subprocess

import pytest

import twofold


@pytest.fixture(scope="session")
def program():
    """The command line's program."""
    program = os.environ.get("TWOFOLD_PROGRAM")
    if not program:
        pytest.skip(
            "TWOFOLD_PROGRAM does not name the program `twofold`, with which answers are compared"
        )
    return program


@pytest.fixture(scope="session")
def command(program):
    """A function that runs it."""

    def run(*arguments, stdin=None):
        done = subprocess.run([program, *arguments], input=stdin, capture_output=True, timeout=300)
        assert done.returncode == 0, done.stderr.decode()
        return done.stdout

    return run


@pytest.fixture(scope="session")
def caricature():
    """The paper's caricature in the reading that gives the paper's story."""
    return twofold.System("caricature").with_(alpha=1e-1, beta=1e-5)


START = [0.2, 0.0, -1.0]
