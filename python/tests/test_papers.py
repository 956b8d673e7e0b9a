"""A paper's folder in Python gives what ``twofold paper`` says of it."""

import json
import subprocess

import numpy as np
import pytest

import twofold


@pytest.fixture
def folder(program, tmp_path):
    place = tmp_path / "paper"
    subprocess.run([program, "paper", "new", str(place)], check=True, capture_output=True)
    return place


def test_claims_are_the_commands(program, folder):
    said = subprocess.run(
        [program, "paper", "make", str(folder), "--quiet", "--json"],
        check=True,
        capture_output=True,
    )
    commands = {claim["claim"]: claim for claim in json.loads(said.stdout)["claims"]}
    paper = twofold.Paper(folder)
    claims = paper.claims()
    assert {claim.id for claim in claims} == set(commands)
    for claim in claims:
        assert claim.agrees == (commands[claim.id]["outcome"] == "agrees")
        for key in ["found", "decided", "rule_after_data", "words_after_data"]:
            assert getattr(claim, key) == commands[claim.id][key], (claim.id, key)
    assert [claim.agrees for claim in twofold.Paper(folder, keep=False).claims(threads=2)] == [
        c.agrees for c in claims
    ]


def test_a_rule_after_its_data_is_said(program, folder):
    make = [program, "paper", "make", str(folder), "--quiet"]
    subprocess.run(make, check=True, capture_output=True)
    file = folder / "claims.toml"
    rule, words = "within = 1e-6", "A narrower loop"
    file.write_text(file.read_text().replace(rule, "within = 1e-3").replace(words, "A tight loop"))
    claims = twofold.Paper(folder).claims()
    assert [(c.rule_after_data, c.words_after_data) for c in claims] == [
        (True, False),
        (False, True),
    ]
    assert claims[0].note == "" and claims[0].quote == ""


SCAN = """
[diagram]
scan = { system = "caricature", over = "start.x=0.1..0.3:4", t-end = 60 }

[endings]
sweep = { system = "systems/relay.toml", over = "params.w=0.2..0.6:4", t-end = 20 }
"""


def test_a_scan_has_the_same_bytes_on_any_number_of_threads(folder):
    with open(folder / "measures.toml", "a") as file:
        file.write(SCAN)
    paper = twofold.Paper(folder, keep=False)
    for name in ["diagram", "endings"]:
        assert paper.answer(name, threads=1).hash == paper.answer(name).hash


def test_what_cannot_be_scored_is_said(folder):
    file = folder / "claims.toml"
    file.write_text(file.read_text().replace('read = "period"', 'read = "point/7"', 1))
    claims = twofold.Paper(folder, keep=False).claims()
    assert claims[0].agrees is None and "there is no" in claims[0].found
    assert claims[1].agrees is True


def test_panels_say_what_they_show_and_have_the_papers_numbers(folder):
    (folder / "data").mkdir()
    (folder / "data" / "read.csv").write_text("t,x\n0,0.5\n12,-0.25\n")
    figure = folder / "figures" / "fig1.toml"
    panel = 'title = "w = 0.1"\n'
    points = 'points = { name = "read off", file = "data/read.csv" }\n'
    figure.write_text(figure.read_text().replace(panel, panel + points))
    paper = twofold.Paper(folder, keep=False)
    assert list(paper.points) == ["fig1/b"]
    assert paper.points["fig1/b"]["y"].tolist() == [0.5, -0.25]
    assert paper.verdicts() == []


def test_answers_are_arrays(folder):
    paper = twofold.Paper(folder, keep=False)
    assert [figure.id for figure in paper.figures] == ["fig1"] and "cycle" in paper.names
    cycle = paper.answer("cycle")
    assert cycle.facts["period"] == pytest.approx(2 * np.log(3), abs=1e-9)
    run = paper.answer("fig1/a")
    table = next(iter(run.tables.values()))
    assert table["t"].dtype == np.float64 and np.all(np.diff(table["t"]) >= 0)
    assert not (folder / "out").exists()


def test_what_is_wrong_is_said_with_its_place(folder):
    with pytest.raises(twofold.SpecError, match='no panel or measure "fig9/a"'):
        twofold.Paper(folder).answer("fig9/a")
    file = folder / "paper.toml"
    file.write_text(file.read_text().replace("title =", "titel ="))
    with pytest.raises(twofold.DefinitionError, match="titel") as caught:
        twofold.Paper(folder)
    assert caught.value.line == 3
    with pytest.raises(twofold.DefinitionError, match="paper.toml"):
        twofold.Paper(folder.parent)
