"""Systems: from names, files, texts and expressions; values; errors that point."""

import json
import pickle

import numpy as np
import pytest

import twofold

TEXT = """
name = "block"
states = ["x", { name = "v", meaning = "speed", unit = "m/s" }]
start = [0, 0]
h = "v - belt"
plus = ["v", "-x - friction"]
minus = ["v", "-x + friction"]
[parameters]
belt = 0.3
friction = { value = 1, meaning = "of the belt" }
"""


def block(**more):
    return twofold.System(
        states=["x", "v"],
        h="v - belt",
        plus=["v", "-x - friction"],
        minus=["v", "-x + friction"],
        parameters={"belt": 0.3, "friction": 1},
        **more,
    )


def test_every_way_gives_the_same_system(tmp_path):
    by_text = twofold.System(TEXT)
    file = tmp_path / "block.toml"
    file.write_text(TEXT, encoding="utf-8")
    for system in [
        twofold.System(str(file)),
        twofold.System(file),
        twofold.System.from_file(file),
        twofold.System.from_toml(TEXT),
    ]:
        assert system == by_text and hash(system) == hash(by_text)
    same = twofold.System(
        name="block",
        states=["x", {"name": "v", "meaning": "speed", "unit": "m/s"}],
        start=[0, 0],
        h="v - belt",
        plus=["v", "-x - friction"],
        minus=["v", "-x + friction"],
        parameters={"belt": 0.3, "friction": {"value": 1, "meaning": "of the belt"}},
    )
    assert same == by_text
    assert by_text.meanings == {"v": "speed [m/s]", "friction": "of the belt"}
    file = tmp_path / "block.json"
    file.write_text(by_text.to_json(), encoding="utf-8")
    assert json.loads(twofold.System(file).to_json()) == json.loads(by_text.to_json())
    assert twofold.System.from_toml(by_text.to_toml()) == by_text


def test_values_are_values():
    system = block()
    other = system.with_(friction=0.5)
    assert (
        system.parameters == {"belt": 0.3, "friction": 1.0} and other.parameters["friction"] == 0.5
    )
    assert other != system and other.with_(friction=1) == system and system != "block"
    assert pickle.loads(pickle.dumps(other)) == other
    precise = system.with_(belt="0.30000000000000000000000000001")
    assert precise != system and precise.parameters == system.parameters
    assert pickle.loads(pickle.dumps(precise)) == precise
    assert "belt=0.3, friction=0.5" in repr(other) and "x, v" in repr(other)
    assert block(let={"unused": "x"}).plus == ["v", "-x - friction"]


def test_built_in_systems():
    names = twofold.builtin_systems()
    assert {"caricature", "two-fold", "wheel"} <= set(names)
    for name in names:
        system = twofold.System(name)
        assert system.name == name and len(system.states) == len(system.plus) == len(system.start)
        assert system.references and pickle.loads(pickle.dumps(system)) == system
    with pytest.raises(twofold.DefinitionError, match='did you mean "caricature"'):
        twofold.System("caricatura")


def test_evaluation():
    h, plus, minus = block().evaluate([0.25, 1.3])
    assert h == 1.0
    np.testing.assert_array_equal(plus, [1.3, -1.25])
    np.testing.assert_array_equal(minus, [1.3, 0.75])
    with pytest.raises(twofold.SpecError, match="2 states"):
        block().evaluate([1.0])


def test_errors_point():
    with pytest.raises(twofold.DefinitionError) as caught:
        block(let={"push": "1 + fricton*x"})
    error = caught.value
    assert isinstance(error, ValueError) and isinstance(error, twofold.TwofoldError)
    assert error.message == "unknown name `fricton`" and error.origin == "<expressions>"
    assert error.help == "did you mean `friction`?"
    lines = str(error).splitlines()
    excerpt, mark = lines[3].split("| ", 1)[1], lines[4].split("| ", 1)[1]
    assert excerpt[mark.index("^") :].startswith("fricton") and mark.count("^") == len("fricton")
    assert error.column == mark.index("^") + 1
    with pytest.raises(twofold.DefinitionError) as caught:
        twofold.System.from_toml("states = ['x']\nh = 'x'\nplus = ['-1']\nminus = ['y']", "my.toml")
    assert (caught.value.origin, caught.value.line, caught.value.column) == ("my.toml", 4, 11)
    with pytest.raises(twofold.DefinitionError):
        twofold.System('{"states": 1}')


def test_bounds_of_parameters():
    system = twofold.System(
        states=["x"],
        h="x",
        plus=["-k"],
        minus=["k"],
        parameters={"k": {"value": 1, "above": 0, "meaning": "pull"}},
    )
    assert pickle.loads(pickle.dumps(system)) == system and system.with_(k=2).parameters == {
        "k": 2.0
    }
    with pytest.raises(twofold.ParameterError, match="pull") as caught:
        system.with_(k=-1)
    assert caught.value.parameter == "k"


@pytest.mark.parametrize("value", [float("inf"), float("nan"), "nonsense", "1e999"])
def test_values_that_are_none(value):
    with pytest.raises(twofold.ParameterError) as caught:
        block().with_(belt=value)
    assert caught.value.parameter == "belt"


def test_unknown_parameters_and_wrong_types():
    with pytest.raises(twofold.ParameterError, match="did you mean `friction`"):
        block().with_(fricton=1)
    for wrong in [
        lambda: block().with_(belt=None),
        lambda: twofold.System(),
        lambda: twofold.System("wheel", h="x"),
        lambda: twofold.System(states="xv", h="x", plus=["x"], minus=["x"]),
        lambda: twofold.System(states=["x"], h="x", plus="x", minus=["x"]),
        lambda: twofold.System(states=["x"], h="x", plus=["x"], minus=["x"], parameters={"a": [1]}),
        lambda: twofold.solve(3),
    ]:
        with pytest.raises(TypeError):
            wrong()
    with pytest.raises(OSError):
        twofold.System("nowhere.toml")


def test_texts_with_odd_letters():
    odd = 'a "quoted" \\ text\twith \x7f, \u00e9 and a\nline'
    system = block(about=odd)
    assert system.about == odd and pickle.loads(pickle.dumps(system)) == system


def test_two_surfaces():
    square = twofold.System(
        states=["x", "y"],
        h="x",
        plus=["-1", "1"],
        minus=["-1", "-1"],
        second={"h": "y", "plus": ["1", "1"], "minus": ["1", "-1"]},
    )
    run = twofold.solve(square, [0.5, 0.25], 3, switch="filippov", exit="at-once:plus")
    # Around |x| + |y| = 0.75 once.
    assert np.allclose(run.y[:, -1], [0.5, 0.25], atol=1e-10)
    assert list(run.events["signs"]) == ["0+", "-0", "0-", "+0"]
    assert run.signs[0] == "++"
    with pytest.raises(TypeError, match="minus"):
        twofold.System(
            states=["x"], h="x", plus=["1"], minus=["1"], second={"h": "x", "plus": ["1"]}
        )
    with pytest.raises(twofold.SpecError, match="four fields"):
        square.evaluate([1.0, 1.0])
