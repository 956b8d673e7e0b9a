"""The same question has the same answer here, in the command line and in the published references,
bit for bit."""

import csv
import io
import json

import numpy as np
import pytest

import twofold
from conftest import START

RUNS = {
    "path": (["--t-end", "30", "--method", "dopri5"], {}),
    "lsoda": (
        ["--t-end", "30", "--method", "lsoda", "--rtol", "1e-10"],
        dict(method="lsoda", rtol=1e-10),
    ),
    "section": (
        ["--t-end", "30", "--method", "dopri5", "--section", "y=0", "--eps", "0.01"],
        dict(plane="y=0", eps=0.01),
    ),
    "kicks": (
        [
            "--t-end", "30", "--method", "dopri5", "--kick-every", "0.3", "--seed", "7",
            "--section", "y=0",
        ],
        dict(plane="y=0", kick_every=0.3, seed=7),
    ),
    "restarts": (
        ["--t-end", "30", "--method", "radau5", "--restart", "7", "--max-step", "0.5"],
        dict(method="radau5", restart=7, max_step=0.5),
    ),
    "hysteretic": (
        [
            "--t-end", "30", "--method", "dopri5", "--switch", "hysteretic", "--hysteresis",
            "single", "--eps", "0.01",
        ],
        dict(switch="hysteretic", hysteresis="single", eps=0.01),
    ),
    "delayed": (
        [
            "--t-end", "30", "--switch", "delayed", "--delay", "0.01", "--history", "flow",
            "--section", "y=0",
        ],
        dict(switch="delayed", delay=0.01, history="flow", plane="y=0"),
    ),
    "delayed-smooth": (
        [
            "--t-end", "10", "--switch", "delayed", "--delay", "0.02", "--eps", "0.01",
            "--transition", "erf", "--method", "radau5",
        ],
        dict(switch="delayed", delay=0.02, eps=0.01, transition="erf", method="radau5"),
    ),
    "relay": (
        ["--t-end", "30", "--switch", "relay", "--band", "0.3", "--inside", "minus"],
        dict(switch="relay", band=0.3, inside="minus"),
    ),
    "relay-section": (
        ["--t-end", "60", "--switch", "relay", "--band", "0.01", "--section", "y=0"],
        dict(switch="relay", band=0.01, plane="y=0"),
    ),
    "perturbed": (["--t-end", "30", "--method", "dopri5", "--sigma", "0.1"], dict(sigma=0.1)),
    "arctan": (
        ["--t-end", "30", "--method", "dopri5", "--transition", "arctan"],
        dict(transition="arctan"),
    ),
    "times": (["--t-end", "30", "--method", "dopri5", "--every", "0.5"], dict(every=0.5)),
    "extended": (["--t-end", "1", "--method", "taylor-extended"], dict(method="taylor-extended")),
    "precise": (
        ["--t-end", "0.3", "--method", "taylor-extended", "--precision", "192", "--order", "40"],
        dict(method="taylor-extended", precision=192, order=40),
    ),
    "filippov": (
        [
            "--t-end", "30", "--switch", "filippov", "--exit", "random:exponential:0.5",
            "--plus-probability", "0.4",
        ],
        dict(switch="filippov", exit="random:exponential:0.5", plus_probability=0.4),
    ),
    "arc": (
        ["--t-end", "30", "--switch", "filippov", "--exit", "after-arc:0.2:minus"],
        dict(switch="filippov", exit="after-arc:0.2:minus"),
    ),
}  # fmt: skip


def cells(text):
    """A CSV file of the command line: its columns, numbers as floats."""
    rows = list(csv.reader(line for line in io.StringIO(text.decode()) if not line.startswith("#")))
    return rows[0], list(zip(*rows[1:]))


@pytest.mark.parametrize("name", RUNS)
def test_flags_and_arguments_ask_the_same_and_get_the_same_bytes(command, caricature, name):
    flags, arguments = RUNS[name]
    flags = ["run", "--reading", "reconstructed", *flags]
    spec = twofold.spec(caricature, START, float(flags[flags.index("--t-end") + 1]), **arguments)
    assert spec == json.loads(command(*flags, "--print-spec"))
    written = command(*flags, "--quiet")
    assert (
        twofold.written(spec)
        == written
        == command("run", "--spec", "-", "--quiet", stdin=json.dumps(spec).encode())
    )
    assert twofold.written(spec, "json") == command(*flags, "--format", "json", "--quiet")
    # And the arrays hold what the file says, to the last bit.
    answer = twofold.run_spec(spec)
    names, columns = cells(written)
    for column, values in zip(names, columns):
        if column in ("t", "x", "y", "z"):
            ours = answer.t if column == "t" else answer[column]
            theirs = np.array([float(v) for v in values])
            assert ours.tobytes() == theirs.tobytes(), column
    assert "t" in names and len(answer) == len(columns[0]) > 5


def test_a_funnel_has_the_same_bytes(command, caricature):
    flags = [
        "--switch",
        "filippov",
        "--exit",
        "all",
        "--funnel-times",
        "2",
        "--funnel-horizon",
        "5",
        "--t-end",
        "100",
        "--funnel-longest",
        "1",
    ]
    funnel = twofold.funnel(caricature, START, 100.0, times=2, horizon=5.0, longest=1.0)
    assert funnel.spec == json.loads(
        command("run", "--reading", "reconstructed", *flags, "--print-spec")
    )
    assert twofold.written(funnel.spec) == command(
        "run", "--reading", "reconstructed", *flags, "--quiet"
    )


def test_a_system_from_a_file_has_the_same_bytes(command, tmp_path):
    text = ('states = ["x", "v"]\nstart = [0, 0]\nh = "v - belt"\nplus = ["v", "-x - '
            'tanh(v)"]\nminus = ["v", "-x + f"]\n[parameters]\nbelt = 0.3\nf = 1\n')
    file = tmp_path / "block.toml"
    file.write_text(text, encoding="utf-8")
    flags = [
        "run",
        "--system",
        str(file),
        "--set",
        "f=0.7",
        "--t-end",
        "20",
        "--method",
        "dopri5",
        "--quiet",
    ]
    assert twofold.written(twofold.spec(twofold.System(file).with_(f=0.7), t_end=20.0)) == command(
        *flags
    )


def test_a_sweep_has_the_same_bytes(command, caricature):
    quick = caricature.with_(beta=1e-4)
    flags = ("sweep --alpha 0.1 --beta 1e-4 --restart 100 --t-end 2000 --method dopri5 --section "
             "y=0 --quiet").split()
    ours = twofold.sweep(
        quick, START, 2000.0, plane="y=0", restart=100.0, over=["eps=1e-3,2e-3", "shift.x=1e-9*2"]
    )
    assert ours.csv == command(*flags, "--over", "eps=1e-3,2e-3", "--over", "shift.x=1e-9*2")
    lottery = twofold.sweep(quick, START, 2000.0, plane="y=0", restart=100.0, over="shift.x=1e-9*3")
    assert lottery.csv == command(*flags, "--runs", "3", "--shift", "1e-9")


def test_outcomes_of_a_general_system_have_the_same_bytes(command):
    flags = "--system impact-oscillator --section v=0 --t-end 60 --over params.w=2,2.1 --quiet"
    ours = twofold.outcomes(
        "impact-oscillator", {"params.w": [2, 2.1]}, section="v=0", t_end=60, threads=2
    )
    assert ours.csv == command("sweep", *flags.split()) and len(ours.ends) == 2
    for wrong in (dict(over={"params.q": [1]}), dict(over={}, section="v")):
        with pytest.raises(twofold.SpecError):
            twofold.outcomes("impact-oscillator", t_end=60, **{"section": "v=0", **wrong})
    for general in ("impact-oscillator", "states = ['x']\nf = ['-x']"):
        with pytest.raises(twofold.DefinitionError, match="ask follow, orbit, .* or outcomes"):
            twofold.solve(general, [1], 1.0)


def test_a_text_of_one_line_is_no_name(tmp_path, monkeypatch):
    line = '{"states": ["x"], "start": [1], "f": ["-x"]}'
    for text in (line, "  " + line, line.replace(", ", ",\n")):
        x = twofold.follow(text, t_end=1.0).tables["path"]["x"]
        assert abs(x[-1] - np.exp(-1.0)) < 1e-8
    for text, why in (
        ("states = ['x']; f = ['-x']", "expected newline"),
        ("{", "EOF while parsing"),
        ("states: [x]", "no such built-in system"),
    ):
        with pytest.raises(twofold.SpecError, match=why):
            twofold.follow(text, t_end=1.0)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x=1.json").write_text(line, encoding="utf-8")
    assert twofold.follow("x=1.json", t_end=1.0).tables["path"]["x"][0] == 1


def test_wrong_numbers_are_no_failed_computations():
    for wrong in (dict(t_end=float("nan")), dict(t_end=-1), dict(tend=1)):
        with pytest.raises(twofold.SpecError):
            twofold.follow("bouncing-ball", **wrong)
    with pytest.raises(twofold.SpecError, match="choose one of fig2, fig4, fig5"):
        twofold.panels("fig77")
    with pytest.raises(TypeError, match="give a name, a file"):
        twofold.follow(None)


def test_figures_have_their_published_hashes():
    panels = twofold.panels("fig5")
    assert {p.reading for p in panels} == {"printed", "reconstructed"}
    for panel in panels:
        assert twofold.run_spec(panel.spec).hash == panel.hash
        assert panel.system.name == "caricature"


def test_verdicts_are_the_published_ones():
    verdicts = twofold.verdicts()
    assert len(verdicts) == 22 and {v.reading for v in verdicts} == {"printed", "reconstructed"}
    table = twofold.verdict_table()
    for reading in ("printed", "reconstructed"):
        agree = sum(v.agrees for v in verdicts if v.reading == reading)
        assert f"{agree} of 11 ({reading})" in table
    assert {v.panel for v in verdicts if v.figure == "fig7"} == {"i", "ii", "iii"}
