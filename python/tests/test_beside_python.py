"""What else goes on while something is computed: other threads, Ctrl-C, progress; and the package's
own promises."""

import doctest
import importlib
import inspect
import io
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest

import twofold
from conftest import START
from twofold._progress import Line, Shown

# Minutes of work, of which a moment is computed: a stiff, noisy run.
LONG = dict(t_end=1e7, plane="y=0", kick_every=0.3, restart=20.0)


def test_other_threads_go_on(caricature):
    counts = []

    def work():
        counts.append(twofold.section(caricature, START, 3e4, plane="y=0"))

    thread = threading.Thread(target=work)
    turns = 0
    thread.start()
    while thread.is_alive():
        turns += 1
        time.sleep(0.001)
    thread.join()
    # With the GIL held for the length of the run there would be next to none.
    assert len(counts[0]) > 1000 and turns > 20


@pytest.mark.skipif(sys.platform == "win32", reason="signals of another kind")
@pytest.mark.parametrize(
    "call",
    [
        "twofold.section('caricature', [0.2, 0, -1], **LONG)",
        "twofold.classify('caricature', [0.2, 0, -1], **LONG)",
        "twofold.sweep('caricature', [[0.2, 0, -1]] * 50, threads=2, **LONG)",
        "twofold.solve('caricature', [0.2, 0, -1], 1e7, chord=10.0, progress=True)",
    ],
)
def test_ctrl_c_stops_within_a_moment(call):
    # A shell starts background jobs with Ctrl-C ignored, and children inherit that.
    heard = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    program = f"{heard}import twofold\nLONG = {LONG!r}\nprint('begun', flush=True)\n{call}\n"
    child = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert child.stdout.readline().strip() == b"begun"
    time.sleep(1.0)
    assert child.poll() is None, child.stderr.read().decode()
    asked = time.monotonic()
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=30)
    assert b"KeyboardInterrupt" in said and child.returncode != 0
    # The computation itself gives in within a tenth of a second; the rest is for busy machines.
    assert time.monotonic() - asked < 5


def test_a_callable_is_told_how_far_it_is(caricature):
    told = []
    twofold.section(
        caricature,
        START,
        1e5,
        plane="y=0",
        progress=lambda share, label: told.append((share, label)),
    )
    assert told and all(
        0 <= share <= 1 and label == "dopri5 to t = 100000" for share, label in told
    )
    assert [s for s, _ in told] == sorted(s for s, _ in told)

    def fails(share, label):
        raise ZeroDivisionError("from the display")

    with pytest.raises(ZeroDivisionError, match="from the display"):
        twofold.section(caricature, START, progress=fails, **LONG)


def test_the_progress_line():
    stream = io.StringIO()
    line = Line(stream, grace=0.0)
    line(0.0, "dopri5 to t = 10")
    line(0.5, "dopri5 to t = 10")
    shown = stream.getvalue()
    assert (
        "\rdopri5 to t = 10:  50 % |############............|" in shown
        and "? left" in shown
        and "\x1b" not in shown
    )
    line.close()
    assert stream.getvalue().endswith(" \r")
    quiet = io.StringIO()
    line = Line(quiet)
    line(0.1, "quick")
    line.close()
    assert quiet.getvalue() == ""
    with Shown(False) as show:
        assert show is None


def test_a_panic_would_be_an_exception_and_errors_are_documented():
    for name in twofold.errors.__all__:
        error = getattr(twofold, name)
        assert issubclass(error, twofold.TwofoldError) and error.__doc__
        assert name == "TwofoldError" or name in twofold.errors.__doc__


def test_everything_public_is_documented():
    for name in twofold.__all__:
        thing = getattr(twofold, name)
        if inspect.isclass(thing):
            for member, value in inspect.getmembers(thing):
                if not member.startswith("_") and (
                    inspect.isfunction(value) or isinstance(value, property)
                ):
                    assert inspect.getdoc(value), f"{name}.{member}"
        if inspect.isclass(thing) or inspect.isfunction(thing):
            assert inspect.getdoc(thing), name
    for word in (
        "solve",
        "section",
        "funnel",
        "classify",
        "sweep",
        "spec",
        "run_spec",
        "panels",
        "verdicts",
    ):
        assert f":func:`{word}`" in twofold.__doc__


@pytest.mark.parametrize(
    "module", ["twofold", "twofold._system", "twofold._runs", "twofold._paper"]
)
def test_examples_in_docstrings(module):
    failed, tried = doctest.testmod(importlib.import_module(module))
    assert failed == 0


def test_types_are_sound(tmp_path):
    """The package under mypy, strictly, the stub of its native half against that, and a user's
    program."""
    where = Path(twofold.__file__).parent
    assert (where / "py.typed").exists() and (where / "_native.pyi").exists()
    program = tmp_path / "program.py"
    program.write_text(
        textwrap.dedent(
            """
            import numpy as np
            from numpy.typing import NDArray
            import twofold

            def norm(system: twofold.System) -> NDArray[np.float64]:
                start = [0.2, 0, -1]
                run: twofold.Solution = twofold.solve(system, start, 10.0, eps=1e-2, progress=True)
                passages = twofold.section(system, None, 5, plane=("y", 0.0))
                return np.concatenate([run.y[0], passages.t])

            verdicts: list[twofold.Verdict] = twofold.verdicts()
            """
        ),
        encoding="utf-8",
    )
    settings = ["--strict", "--cache-dir", str(tmp_path / "cache")]
    for arguments in [
        ["mypy", *settings, "-p", "twofold"],
        ["mypy", *settings, str(program)],
        ["mypy.stubtest", "twofold._native"],
    ]:
        done = subprocess.run(
            [sys.executable, "-m", *arguments], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_notebook_tells_its_story():
    """Every cell, in order, in a real kernel."""
    import nbformat
    from nbclient import NotebookClient

    path = Path(__file__).parent.parent / "notebooks" / "story.ipynb"
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert all(not cell.get("outputs") for cell in notebook.cells), "outputs are not committed"
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    outputs = [o for cell in notebook.cells if cell.cell_type == "code" for o in cell.outputs]
    pictures = [o for o in outputs if "image/png" in o.get("data", {})]
    assert len(pictures) >= 4
