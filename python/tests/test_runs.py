"""Runs: shapes, contents, refusals."""

import json

import numpy as np
import pytest

import twofold
from conftest import START


def test_a_path(caricature):
    run = twofold.solve(caricature, START, 20.0, rtol=1e-9, atol=1e-9)
    assert run.t.shape == (len(run),) and run.y.shape == (3, len(run))
    assert run.t.dtype == run.y.dtype == np.float64
    assert run.t[0] == 0 and run.t[-1] == run.t_final == 20.0 and np.all(np.diff(run.t) > 0)
    np.testing.assert_array_equal(run.y[:, 0], START)
    np.testing.assert_array_equal(run.y[:, -1], run.y_final)
    assert (
        run.success
        and run.status == 0
        and run.stop == "finished"
        and "reached its end" in run.message
    )
    assert (
        run.nfev == run.statistics["evaluations"] > run.statistics["steps"] > 0
        and run.njev == run.nlu == 0
    )
    assert run.mode is None and run.piece is None and run.events is None
    assert run.system is caricature and len(run.hash) == 64
    # The field at the start is what the first points say.
    h, plus, _ = caricature.evaluate(START)
    assert h > 0
    i = np.searchsorted(run.t, 1e-2)
    np.testing.assert_allclose((run.y[:, i] - run.y[:, 0]) / run.t[i], plus, atol=0.1)


def test_points_at_fixed_times(caricature):
    run = twofold.solve(caricature, START, 10.0, every=0.5)
    np.testing.assert_array_equal(run.t, np.arange(21) * 0.5)
    sliding = twofold.solve(
        caricature, START, 10.0, every=0.5, switch="filippov", exit="at-once:plus"
    )
    assert set(np.arange(21) * 0.5) <= set(sliding.t) and len(sliding.mode) == len(sliding)


def test_states_are_the_recorded_columns(caricature):
    run = twofold.solve(caricature, START, 5.0)
    x = run["x"]
    # The job's own vector, handed over: NumPy does not own it, and gives it out again and again.
    assert not x.flags.owndata and run["x"] is x and run.t is run.t
    y = run.y
    np.testing.assert_array_equal(y[0], x)
    assert run.y is y and np.shares_memory(run["x"], y)
    with pytest.raises(KeyError, match="x, y, z"):
        run["w"]


def test_a_section(caricature):
    passages = twofold.section(caricature, START, 60.0, plane="y=0")
    assert passages.y.shape == (3, len(passages)) and len(passages) > 5
    np.testing.assert_allclose(passages["y"], 0.0, atol=1e-12)
    assert passages.direction.dtype == np.int8 and set(passages.direction) == {-1, 1}
    np.testing.assert_array_equal(passages.up, passages.direction == 1)
    for plane in [("y", 0), (1, 0.0), "y = 0.0"]:
        assert twofold.section(caricature, START, 60.0, plane=plane).hash == passages.hash


def test_filippov_motion(caricature):
    run = twofold.solve(caricature, START, 40.0, switch="filippov", exit="after-time:0.3:plus")
    assert set(run.mode) == {"plus", "minus", "sliding-attracting", "sliding-repelling"}
    sliding = np.char.startswith(run.mode, "sliding")
    np.testing.assert_allclose(run["x"][sliding], 0.0, atol=1e-9)
    assert np.all(run["x"][run.mode == "plus"] > -1e-9)
    assert run.piece.dtype == np.int64 and np.all(np.diff(run.piece) >= 0)
    events = run.events
    assert "two-fold-reached" in events.event and events.rows == len(events["t"])
    exits = events.event == "exit"
    np.testing.assert_allclose(events.time[exits], 0.3)
    assert set(events.side[exits]) == {"plus"}
    assert dict(events).keys() == set(events) and "rows" in repr(events)
    with pytest.raises(AttributeError, match="event"):
        events.nothing
    # Without an exit it goes as far as nothing has to be chosen.
    with pytest.raises(twofold.ComputationError, match="not decided"):
        twofold.solve(caricature, START, 400.0, switch="filippov")


def test_a_funnel(caricature):
    funnel = twofold.funnel(
        caricature, START, 100.0, times=3, shortest=0.1, longest=1.0, horizon=10.0
    )
    assert funnel.stop == "set-valued" and not funnel.success and funnel.status == 1
    np.testing.assert_allclose(funnel.point, 0.0, atol=1e-6)
    assert len(funnel.futures) == 6
    np.testing.assert_allclose(
        sorted({f.exit_time for f in funnel.futures}), [0.1, np.sqrt(0.1), 1.0]
    )
    assert [f.side for f in funnel.futures] == ["plus", "minus"] * 3
    total = 0
    for future in funnel.futures:
        assert future.y.shape == (3, len(future)) and len(future.mode) == len(future)
        assert "exit" in future.events.event and np.all(np.diff(future.t) >= 0)
        total += len(future)
    assert total > 100 and funnel.y.shape == (3, len(funnel))
    with pytest.raises(twofold.ComputationError, match="no set-valued point before the end"):
        twofold.funnel(caricature, START, 0.1)


def test_two_states_and_a_system_of_ones_own():
    block = twofold.System(
        states=["x", "v"],
        h="v - belt",
        plus=["v", "-x - friction"],
        minus=["v", "-x + friction"],
        parameters={"belt": 0.3, "friction": 1},
        start=[0, 0],
    )
    run = twofold.solve(block, t_end=30, switch="filippov", exit="at-once:plus")
    sticking = run.mode == "sliding-attracting"
    assert sticking.any()
    np.testing.assert_allclose(run["v"][sticking], 0.3, atol=1e-12)
    # The block slips when the spring's pull is the friction: x = 1 in this convention.
    slips = run.events["x"][run.events.event == "left-by-tangency"]
    np.testing.assert_allclose(np.abs(slips), 1.0, atol=1e-6)


@pytest.mark.parametrize("method", ["lsoda", "dopri5", "radau5", "taylor"])
def test_methods_agree_before_the_singularity(caricature, method):
    run = twofold.solve(caricature, START, 1.0, method=method, rtol=1e-9, atol=1e-9)
    fine = twofold.solve(caricature, START, 1.0, method="taylor-extended", rtol=1e-20, atol=1e-20)
    np.testing.assert_allclose(run.y_final, fine.y_final, atol=1e-6)
    assert method in ("dopri5", "taylor") or run.njev > 0 or method == "lsoda"


def test_kicks_have_seeds(caricature):
    kicked = dict(kick_every=0.3, t_end=10.0)
    a, b, c = (twofold.solve(caricature, START, **kicked, seed=s) for s in (1, 1, 2))
    assert a.hash == b.hash != c.hash
    assert twofold.solve(caricature, START, **kicked, seed=1, stream=1).hash != a.hash


def test_a_spec_asks_the_same(caricature):
    asked = twofold.spec(caricature, START, 30.0, plane="y=0", eps=1e-2, restart=10.0)
    answer = twofold.section(caricature, START, 30.0, plane="y=0", eps=1e-2, restart=10.0)
    for form in [asked, json.dumps(asked), json.dumps(asked).encode()]:
        again = twofold.run_spec(form)
        assert (
            type(again) is twofold.Section
            and again.hash == answer.hash
            and again.question == answer.question
        )
    assert answer.spec == asked
    assert type(twofold.run_spec(twofold.spec(caricature, START, 1.0))) is twofold.Solution


WRONG = [
    (dict(t_end=-1), "t_end"),
    (dict(t_end=float("nan")), "t_end"),
    (dict(t_end="soon"), "t_end"),
    (dict(start=[1, 2]), "start"),
    (dict(start=[1, 2, float("inf")]), "start"),
    (dict(start="here"), "start"),
    (dict(eps=0), "eps"),
    (dict(rtol=1e-30), "rtol"),
    (dict(atol=-1.0), "atol"),
    (dict(method="euler"), "spec"),
    (dict(transition="step"), "spec"),
    (dict(chord=0.0), "chord"),
    (dict(chord=1e-2, every=1.0), "chord"),
    (dict(every=-1.0), "every"),
    (dict(max_steps=0), "max_steps"),
    (dict(precision=192), "precision"),
    (dict(order=40), "order"),
    (dict(method="taylor-extended", precision=128), "precision"),
    (dict(method="taylor-extended", order=3), "order"),
    (dict(method="taylor-extended", rtol=1e-60), "rtol"),
    (dict(max_steps=1.5), "max_steps"),
    (dict(switch="none"), "switch"),
    (dict(eps_prime=1e-2), "eps_prime"),
    (dict(hysteresis="single"), "hysteresis"),
    (dict(exit="at-once:plus"), "exit"),
    (dict(plus_probability=0.4), "plus_probability"),
    (dict(kick_size=1e-2), "kick_size"),
    (dict(kick_law="cube"), "kick_law"),
    (dict(seed=1), "seed"),
    (dict(stream=1), "stream"),
    (dict(kick_every=0.3, seed=-1), "seed"),
    (dict(sigma=0.1, transition="arctan"), "transition"),
    (dict(switch="hysteretic", sigma=0.1), "sigma"),
    (dict(switch="hysteretic", transition="tanh"), "transition"),
    (dict(delay=1e-2), "delay"),
    (dict(history="flow"), "history"),
    (dict(switch="relay"), "band"),
    (dict(switch="relay", band=0.0), "band"),
    (dict(switch="relay", band=1e-2, eps=1e-3), "eps"),
    (dict(switch="relay", band=1e-2, inside="plus"), "inside"),
    (dict(switch="delayed", delay=1e-2, band=1e-2), "band"),
    (dict(switch="delayed"), "delay"),
    (dict(switch="delayed", delay=0.0), "delay"),
    (dict(switch="delayed", delay=1e-2, transition="erf"), "transition"),
    (dict(switch="delayed", delay=1e-2, method="lsoda"), "method"),
    (dict(switch="delayed", delay=1e-2, history="none"), "spec"),
    (dict(switch="filippov", exit="all"), "exit"),
    (dict(switch="filippov", exit="nonsense"), "exit"),
    (dict(switch="filippov", exit="at-once:up"), "exit"),
    (dict(switch="filippov", exit="after-time:x:plus"), "exit"),
    (dict(switch="filippov", exit="random:gauss:1"), "exit"),
    (dict(switch="filippov", exit=1), "exit"),
    (dict(switch="filippov", exit="at-once:plus", eps=1e-2), "eps"),
    (dict(switch="filippov", exit="at-once:plus", seed=3), "seed"),
    (dict(switch="filippov", exit="at-once:plus", plus_probability=0.3), "plus_probability"),
    (dict(switch="filippov", exit="at-once:plus", restart=1.0), "restart"),
    (dict(switch="filippov", exit="at-once:plus", method="lsoda"), "method"),
]


@pytest.mark.parametrize("arguments, field", WRONG, ids=[str(a) for a, _ in WRONG])
def test_nothing_wrong_is_computed_and_nothing_is_ignored(caricature, arguments, field):
    with pytest.raises(twofold.SpecError) as caught:
        twofold.solve(caricature, **{"start": START, "t_end": 1.0, **arguments})
    assert caught.value.field == field and isinstance(caught.value, ValueError)


def test_wrong_planes_funnels_and_specs(caricature):
    for plane in ["q=0", "y", "y=here", ("y",), (7, 0), ("y", float("nan")), 3]:
        with pytest.raises(twofold.SpecError) as caught:
            twofold.section(caricature, START, 1.0, plane=plane)
        assert caught.value.field == "plane"
    with pytest.raises(TypeError, match="chord"):
        twofold.funnel(caricature, START, 1.0, chord=1e-3)
    for options in [
        dict(exit="at-once:plus"),
        dict(switch="filippov"),
        dict(eps=1.0),
        dict(times=0),
        dict(seed=1),
    ]:
        with pytest.raises(twofold.SpecError):
            twofold.funnel(caricature, START, 1.0, **options)
    for spec in ["", "[]", "{}", '{"system": {}}', {"system": float("nan")}]:
        with pytest.raises((twofold.SpecError, twofold.DefinitionError)):
            twofold.run_spec(spec)
    with pytest.raises(TypeError, match="epsilon"):
        twofold.section(caricature, START, 1.0, plane="y=0", epsilon=1.0)
    with pytest.raises(twofold.SpecError, match="suggests no start"):
        twofold.solve(twofold.System(states=["x"], h="x", plus=["-1"], minus=["1"]))


def test_a_run_that_cannot_be_computed():
    blow_up = twofold.System(states=["x"], h="x", plus=["x^2"], minus=["1"])
    with pytest.raises(twofold.ComputationError) as caught:
        twofold.solve(blow_up, [1.0], 2.0)
    assert isinstance(caught.value, RuntimeError) and isinstance(caught.value, twofold.TwofoldError)


def test_classification(caricature):
    # Attraction is quicker with more of it: alpha = 0.1, beta = 1e-4.
    quick = caricature.with_(beta=1e-4)
    found = twofold.classify(quick, START, 2e4, plane="y=0", restart=100.0, eps=1e-3)
    assert found.end == f"period {found.period}" and found.period in (1, 3, 18)
    assert 0 < found.captured_at < 2e4 and found.summary and found.evidence["crossings"] > 1000
    assert found.exponent is None


def test_a_sweep_does_not_depend_on_threads(caricature):
    quick = caricature.with_(beta=1e-4)
    starts = twofold.shifted(START, 4, 1e-9)
    np.testing.assert_array_equal(starts[:, 1:], np.tile(START[1:], (4, 1)))
    np.testing.assert_array_equal(starts[:, 0], [0.2 + k * 1e-9 for k in (1, 2, 3, 4)])
    run = dict(plane="y=0", restart=100.0, t_end=3e3)
    sweeps = [twofold.sweep(quick, starts, **run, threads=n) for n in (1, 2)]
    sweeps += [twofold.sweep(quick, START, over="shift.x=1e-9*4", **run, threads=n) for n in (1, 2)]
    assert sweeps[2].csv == sweeps[3].csv and sweeps[0].csv is None
    for name in sweeps[0].table:
        columns = [s.table[name] for s in sweeps if name in s.table]
        assert len(columns) == (2 if name.startswith("start.") else 4)
        for column in columns:
            np.testing.assert_array_equal(column, columns[0], err_msg=name)
            assert column.dtype.kind == columns[0].dtype.kind and len(column) == 4
    assert sum(sweeps[0].counts.values()) == len(sweeps[0]) == 4 and sweeps[0].errors == [None] * 4
    assert all(s.ends == sweeps[0].ends for s in sweeps)


def test_a_sweep_over_a_grid_and_draws(caricature):
    grid = twofold.sweep(
        caricature, START, 50.0, plane="y=0", over=["params.alpha=0.1,0.2", "method=dopri5,lsoda"]
    )
    assert len(grid) == 4 and list(grid.table["method"]) == ["dopri5", "lsoda"] * 2
    np.testing.assert_array_equal(grid.table["params.alpha"], [0.1, 0.1, 0.2, 0.2])
    drawn = [
        twofold.sweep(
            caricature, None, 20.0, plane="y=0", over="shift.x=-1e-9..1e-9", random=3, random_seed=s
        )
        for s in (1, 1, 2)
    ]
    shifts = [d.table["shift.x"] for d in drawn]
    np.testing.assert_array_equal(shifts[0], shifts[1])
    assert len(set(shifts[0])) == 3 and not set(shifts[0]) & set(shifts[2])


def test_wrong_sweeps(caricature):
    for start, more in [
        (START, {}),
        (np.empty((0, 3)), {}),
        ([[1, 2]], {}),
        ([START], dict(over="shift.x=1e-9*4")),
        (START, dict(over="nonsense")),
        (START, dict(over="kick-size=1,2")),
        (START, dict(over="shift.x=0..1")),
        (START, dict(over="shift.x=1*2", random=2)),
        (START, dict(over="shift.x=1*2", random_seed=2)),
    ]:
        with pytest.raises(twofold.SpecError):
            twofold.sweep(caricature, start, 10.0, plane="y=0", **more)


def test_a_failed_run_discards_no_other():
    # From x > 0 the third state blows up; from x < 0 nothing does.
    system = twofold.System(
        states=["x", "y", "z"], h="x", plus=["0", "1", "1 + z^2"], minus=["0", "z", "-y"]
    )
    done = twofold.sweep(system, [[1, 0, 0], [-1, 1, 1]], 500.0, plane="y=0.5")
    assert (
        done.ends[0] == "failed"
        and "grows without bound near t = 1.57" in done.errors[0]
        and np.isnan(done.table["end"][0])
    )
    assert done.ends[1] != "failed" and done.errors[1] is None
