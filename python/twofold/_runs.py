"""Runs: a question as data (a spec), and answers as NumPy arrays."""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from collections.abc import Mapping as MappingBase
from dataclasses import dataclass, field
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from ._progress import Show, Shown
from ._system import System, as_system
from .errors import SpecError

Floats = NDArray[np.float64]
SystemLike = Union[System, str, "os.PathLike[str]"]
Plane = Union[str, Tuple[Union[str, int], float]]
Progress = Union[bool, Show]

__all__ = [
    "Classification", "Funnel", "Future", "Section", "Solution", "Sweep", "Table",
    "classify", "funnel", "run_spec", "section", "shifted", "solve", "spec", "sweep", "written",
]  # fmt: skip


# The question -------------------------------------------------------------------------------------


def _refuse(given: Mapping[str, Any], why: str) -> None:
    """What would have no effect is an error, never ignored."""
    for name, value in given.items():
        if value is not None:
            raise SpecError(f"{name} would have no effect: {why}", name)


def _finite(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise SpecError(f"{name} is {value!r}: give a number", name) from None
    if not math.isfinite(number):
        raise SpecError(f"{name} is {number}: give a finite number", name)
    return number


def _count(name: str, value: Any) -> int:
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, np.integer))
        or not 0 <= int(value) < 2**64
    ):
        raise SpecError(f"{name} is {value!r}: give a whole number from 0 to 2^64 - 1", name)
    return int(value)


def _exit(
    rule: Any, plus_probability: Optional[float], seed: Optional[int], stream: Optional[int]
) -> Any:
    """Reads "after-time:0.3:minus" as the command line does."""
    wrong = SpecError(
        f"exit is {rule!r}: give at-once:SIDE, after-time:T:SIDE or after-arc:L:SIDE with SIDE "
        "plus or minus; "
        "random:exponential:MEAN or random:uniform:LONGEST",
        "exit",
    )
    if not isinstance(rule, str):
        raise wrong
    words = rule.split(":")
    chance = {"plus_probability": plus_probability, "seed": seed, "stream": stream}
    try:
        if words[0] == "random":
            kind, length = words[1], float(words[2])
            law = {
                "exponential": {"exponential": {"mean": length}},
                "uniform": {"uniform": {"longest": length}},
            }[kind]
            if len(words) != 3 or not math.isfinite(length):
                raise wrong
            return {
                "random": {
                    "law": law,
                    "plus_probability": 0.5
                    if plus_probability is None
                    else _finite("plus_probability", plus_probability),
                    "seed": 2013 if seed is None else _count("seed", seed),
                    "stream": 0 if stream is None else _count("stream", stream),
                }
            }
        side = words[-1]
        if side not in ("plus", "minus"):
            raise wrong
        if words[0] == "at-once" and len(words) == 2:
            form: Any = {"at-once": {"side": side}}
        elif words[0] in ("after-time", "after-arc") and len(words) == 3:
            form = {words[0]: {words[0].split("-")[1]: _finite("exit", words[1]), "side": side}}
        else:
            raise wrong
    except (IndexError, KeyError, ValueError) as error:
        raise (error if isinstance(error, SpecError) else wrong) from None
    _refuse(chance, "nothing in this run is random; leave it out, or give a random exit")
    return form


def _spec(
    system: SystemLike,
    start: Optional[ArrayLike],
    t_end: float,
    observe: Any,
    funnel: Optional[Dict[str, Any]] = None,
    *,
    switch: str = "smoothed",
    delay: Optional[float] = None,
    history: Optional[str] = None,
    band: Optional[float] = None,
    inside: Optional[str] = None,
    eps: Optional[float] = None,
    transition: Optional[str] = None,
    sigma: Optional[float] = None,
    eps_prime: Optional[float] = None,
    hysteresis: Optional[str] = None,
    exit: Optional[str] = None,
    plus_probability: Optional[float] = None,
    method: str = "dopri5",
    rtol: Optional[float] = None,
    atol: Optional[float] = None,
    max_step: Optional[float] = None,
    max_steps: Optional[int] = None,
    precision: Optional[int] = None,
    order: Optional[int] = None,
    restart: Optional[float] = None,
    kick_every: Optional[float] = None,
    kick_size: Optional[float] = None,
    kick_law: Optional[str] = None,
    seed: Optional[int] = None,
    stream: Optional[int] = None,
) -> Tuple[System, Dict[str, Any]]:
    system = as_system(system)
    if start is None:
        suggested = system.start
        if suggested is None:
            raise SpecError(
                f"the system suggests no start: give one, {len(system.states)} numbers", "start"
            )
        state = suggested
    else:
        try:
            state = np.asarray(start, dtype=np.float64)
        except (TypeError, ValueError):
            raise SpecError(
                f"start is {start!r}: give {len(system.states)} numbers", "start"
            ) from None
        if state.shape != (len(system.states),):
            names = ", ".join(system.states)
            raise SpecError(
                f"start has the shape {state.shape}: give {len(system.states)} numbers, one for "
                f"each of {names}",
                "start",
            )
    width = 1e-3 if eps is None else _finite("eps", eps)
    kicks = {"kick_size": kick_size, "kick_law": kick_law}
    of_hysteresis = {"eps_prime": eps_prime, "hysteresis": hysteresis}
    of_smoothing = {"transition": transition, "sigma": sigma}
    of_filippov = {"exit": exit, "plus_probability": plus_probability}
    shape: Any = transition or "tanh"
    if sigma is not None and switch in ("smoothed", "delayed"):
        other = None if transition == "tanh" else transition
        _refuse({"transition": other}, "sigma perturbs tanh; leave one of the two out")
        shape = {"perturbed-tanh": {"sigma": _finite("sigma", sigma)}}
    if switch != "delayed":
        _refuse({"delay": delay, "history": history}, 'it belongs to switch="delayed"')
    if switch != "relay":
        _refuse({"band": band, "inside": inside}, 'it belongs to switch="relay"')
    model: Any
    if switch == "smoothed":
        _refuse(of_hysteresis, 'it belongs to switch="hysteretic"')
        _refuse(of_filippov, 'it belongs to switch="filippov"')
        model = {"smoothed": {"eps": width, "transition": shape}}
    elif switch == "delayed":
        _refuse(of_hysteresis, 'it belongs to switch="hysteretic"')
        _refuse(of_filippov, 'it belongs to switch="filippov"')
        if delay is None:
            raise SpecError(
                'switch="delayed" needs its delay: give one, such as delay=1e-3', "delay"
            )
        model = {"delayed": {"delay": _finite("delay", delay), "history": history or "constant"}}
        if eps is None:
            _refuse(of_smoothing, "the sharp delayed switch has no transition; give eps, too")
        else:
            model["delayed"].update(eps=width, transition=shape)
    elif switch == "relay":
        _refuse({"eps": eps}, "a relay has a band and no eps")
        _refuse(of_smoothing, 'it belongs to switch="smoothed"')
        _refuse(of_hysteresis, 'it belongs to switch="hysteretic"')
        _refuse(of_filippov, 'it belongs to switch="filippov"')
        if band is None:
            raise SpecError(
                'switch="relay" needs its band: give half its width, such as band=1e-3', "band"
            )
        model = {"relay": {"band": _finite("band", band), "inside": inside or "sign"}}
    elif switch == "hysteretic":
        _refuse(of_smoothing, 'it belongs to switch="smoothed"')
        _refuse(of_filippov, 'it belongs to switch="filippov"')
        prime = 10.0 * width if eps_prime is None else _finite("eps_prime", eps_prime)
        model = {
            "hysteretic": {
                "eps": width,
                "eps_prime": prime,
                "relaxation": hysteresis or "literal",
                "phi0": 1.0,
            }
        }
    elif switch == "filippov":
        _refuse({"eps": eps}, "the discontinuous system has no eps")
        _refuse(of_smoothing, 'it belongs to switch="smoothed"')
        _refuse(of_hysteresis, 'it belongs to switch="hysteretic"')
        _refuse(
            {"restart": restart, "kick_every": kick_every, **kicks},
            "only the other switches' runs have restarts and kicks",
        )
        if funnel is not None:
            _refuse(
                {"plus_probability": plus_probability, "seed": seed, "stream": stream},
                "nothing in a funnel is random",
            )
            model = {"filippov": {"exit": "all", "funnel": funnel}}
        elif exit is None:
            # The run ends with an error where a choice is needed.
            _refuse(
                {"plus_probability": plus_probability, "seed": seed, "stream": stream},
                "it belongs to a random exit",
            )
            model = {"filippov": {"exit": "undecided"}}
        elif exit == "all":
            raise SpecError('exit="all" follows every future: that is twofold.funnel', "exit")
        else:
            model = {"filippov": {"exit": _exit(exit, plus_probability, seed, stream)}}
    else:
        raise SpecError(
            f'switch is {switch!r}: give "smoothed", "hysteretic", "delayed", "relay" or '
            '"filippov"',
            "switch",
        )
    kick = None
    if switch != "filippov":
        if kick_every is None:
            _refuse(kicks, "there are no kicks; give kick_every")
            _refuse(
                {"seed": seed, "stream": stream}, "nothing in this run is random; give kick_every"
            )
        else:
            kick = {
                "every": _finite("kick_every", kick_every),
                "size": width if kick_size is None else _finite("kick_size", kick_size),
                "law": kick_law or "sphere",
                "seed": 2013 if seed is None else _count("seed", seed),
                "stream": 0 if stream is None else _count("stream", stream),
            }
    of_extended = {"precision": precision, "order": order}
    tolerance = _native.DEFAULT_TOLERANCE
    if method == "taylor-extended":
        finest = _native.DEFAULT_TOLERANCES_EXTENDED
        # What has no such entry is refused with the spec, which knows the reason.
        tolerance = finest.get(
            min(finest) if precision is None else _count("precision", precision),
            min(finest.values()),
        )
    else:
        _refuse(of_extended, 'it belongs to method="taylor-extended"')
    start = [_finite("start", x) for x in state]
    return system, {
        "system": json.loads(system.to_json()),
        "switch": model,
        "start": start,
        "t_end": _finite("t_end", t_end),
        "method": {
            "name": method,
            "tolerance": {
                "rtol": tolerance if rtol is None else _finite("rtol", rtol),
                "atol": _native.default_atol(tolerance, start)
                if atol is None
                else _finite("atol", atol),
            },
            "step_cap": {"fraction-of-segment": 0.1}
            if max_step is None
            else {"absolute": _finite("max_step", max_step)},
            "max_steps": _native.DEFAULT_MAX_STEPS
            if max_steps is None
            else _count("max_steps", max_steps),
            **{
                name: _count(name, value)
                for name, value in of_extended.items()
                if value is not None
            },
        },
        "schedule": {
            "restart_every": None if restart is None else _finite("restart", restart),
            "kick": kick,
        },
        "observe": observe,
    }


def _path(chord: Optional[float], every: Optional[float]) -> Dict[str, Any]:
    if every is None:
        return {"path": {"chord": 1e-3 if chord is None else _finite("chord", chord)}}
    _refuse({"chord": chord}, "points at fixed times have no chord; leave one of the two out")
    return {"times": {"every": _finite("every", every)}}


def _plane(system: SystemLike, plane: Plane) -> Dict[str, Any]:
    names = as_system(system).states
    wrong = SpecError(
        f'plane is {plane!r}: give a state and its value, such as '
        f'"{names[min(1, len(names) - 1)]}=0"; the states are {", ".join(names)}',
        "plane",
    )
    if isinstance(plane, str):
        name, equals, text = plane.partition("=")
        try:
            state, value = name.strip(), float(text)
        except ValueError:
            raise wrong from None
        if not equals:
            raise wrong
    else:
        try:
            state, value = plane  # type: ignore[assignment]
        except (TypeError, ValueError):
            raise wrong from None
    if isinstance(state, (int, np.integer)) and not isinstance(state, bool):
        coordinate = int(state)
    else:
        coordinate = names.index(state) if state in names else -1
    if not 0 <= coordinate < len(names):
        raise wrong
    return {"section": {"coordinate": coordinate, "value": _finite("plane", value)}}


# Answers ------------------------------------------------------------------------------------------


def _words(column: Tuple[NDArray[np.uint32], List[str]]) -> NDArray[np.str_]:
    codes, vocabulary = column
    return np.asarray(vocabulary or [""], dtype=np.str_)[codes]


class Table(MappingBase):  # type: ignore[type-arg]
    """Named columns of one length: ``table["t"]``, or ``table.t``. Numbers are float64 (NaN is a
    blank), whole numbers int64, words str."""

    def __init__(self, columns: Mapping[str, Any]) -> None:
        self._columns: Dict[str, Any] = dict(columns)

    def __getitem__(self, name: str) -> NDArray[Any]:
        column = self._columns[name]
        if isinstance(column, tuple):
            column = self._columns[name] = _words(column)
        return column  # type: ignore[no-any-return]

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name.startswith("_") or name not in self._columns:
            raise AttributeError(
                f"there is no column {name!r} among {', '.join(self.__dict__.get('_columns', {}))}"
            )
        return self[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        """Number of columns."""
        return len(self._columns)

    @property
    def rows(self) -> int:
        """Number of rows."""
        first = next(iter(self._columns.values()), ())
        return len(first[0] if isinstance(first, tuple) else first)

    def _rows(self, rows: slice) -> Table:
        part = {
            k: (c[0][rows], c[1]) if isinstance(c, tuple) else c[rows]
            for k, c in self._columns.items()
        }
        return Table(part)

    def __repr__(self) -> str:
        return f"<twofold.Table of {self.rows} rows: {', '.join(self._columns)}>"


class _Points:
    """Points with times, state by state, as they were recorded."""

    system: System
    """The system."""

    def __init__(self, system: System, table: Table) -> None:
        self.system = system
        self._table = table
        self._y: Optional[Floats] = None

    @property
    def t(self) -> Floats:
        """Times, shape (points,)."""
        return self._table["t"]

    @property
    def y(self) -> Floats:
        """States, shape (states, points), in the order of ``system.states``.

        Made from the recorded columns when it is first asked for; a single state
        (``solution["x"]``) is the recorded column itself.
        """
        if self._y is None:
            names = self.system.states
            self._y = np.empty((len(names), len(self.t)))
            for i, name in enumerate(names):
                self._y[i] = self._table[name]
                # From now on a view of the same memory.
                self._table._columns[name] = self._y[i]
        return self._y

    def __getitem__(self, state: str) -> Floats:
        """A state by name, shape (points,)."""
        if state not in self.system.states:
            raise KeyError(f"there is no state {state!r} among {', '.join(self.system.states)}")
        return self._table[state]

    def __len__(self) -> int:
        """Number of points."""
        return len(self.t)


_MESSAGES = {
    "finished": "the run reached its end",
    "set-valued": "the run came to a point whose future is a set",
    "step-budget": "the budget of steps was used up",
}


@dataclass(frozen=True)
class _Facts:
    """What is known about a run beside its points."""

    spec: Dict[str, Any] = field(repr=False)
    stop: str
    statistics: Dict[str, int]
    hash: str
    question: str
    facts: Dict[str, Any]


class _Answer(_Points):
    """What all runs have in common."""

    def __init__(self, system: System, table: Table, facts: _Facts) -> None:
        super().__init__(system, table)
        self._facts = facts

    @property
    def spec(self) -> Dict[str, Any]:
        """Everything that the run depends on, as ``twofold run --spec`` reads it (``json.dump``
        it)."""
        return self._facts.spec

    @property
    def stop(self) -> str:
        """Why the run ended: "finished", or "set-valued"."""
        return self._facts.stop

    @property
    def success(self) -> bool:
        """Whether the run did all that was asked."""
        return self.stop == "finished"

    @property
    def status(self) -> int:
        """0 if the run did all that was asked, else 1."""
        return 0 if self.success else 1

    @property
    def message(self) -> str:
        """Why the run ended, in words."""
        return f"{_MESSAGES.get(self.stop, self.stop)} at t = {self.t_final}"

    @property
    def t_final(self) -> float:
        """The last time."""
        return float(self._facts.facts["t"])

    @property
    def y_final(self) -> Floats:
        """The state at the last time, shape (states,)."""
        return np.array(self._facts.facts["state"])

    @property
    def statistics(self) -> Dict[str, int]:
        """Work done: steps, rejected, evaluations, jacobians, factorisations, restarts, ..."""
        return self._facts.statistics

    @property
    def nfev(self) -> int:
        """Evaluations of the right-hand side, without those made for Jacobians."""
        return self.statistics["evaluations"]

    @property
    def njev(self) -> int:
        """Evaluations of the Jacobian."""
        return self.statistics["jacobians"]

    @property
    def nlu(self) -> int:
        """LU decompositions."""
        return self.statistics["factorisations"]

    @property
    def hash(self) -> str:
        """SHA-256 of all recorded numbers' bits, facts and stop reason: the ``data`` hash of
        manifests, the same on any machine."""
        return self._facts.hash

    @property
    def question(self) -> str:
        """SHA-256 of the spec's canonical form: the ``spec`` hash of manifests."""
        return self._facts.question

    def __repr__(self) -> str:
        name = self.system.name or ", ".join(self.system.states)
        return f"<twofold.{type(self).__name__} of {name}: {len(self)} points, {self.message}>"


class Solution(_Answer):
    """A path. Like SciPy's: ``t`` (points,), ``y`` (states, points), ``message``, ``success``,
    ``nfev``, ``njev``, ``nlu``.

    The points are those of a polyline that stays within ``chord`` of the dense output;
    ``solution["x"]`` is a state by name. In the discontinuous system there are also ``mode``,
    ``piece`` and ``events``.
    """

    events: Optional[Table]
    """What happened at the switching surface (``switch="filippov"``), else None: columns t, the
    states, event, from, to, side, leg, error, time, arc, rule; one row an event."""

    def __init__(
        self, system: System, table: Table, facts: _Facts, events: Optional[Table]
    ) -> None:
        super().__init__(system, table, facts)
        self.events = events

    @property
    def mode(self) -> Optional[NDArray[np.str_]]:
        """Where each point is, shape (points,): "plus", "minus", "sliding-attracting" or
        "sliding-repelling"; None if the switch is not Filippov's."""
        return self._table["mode"] if "mode" in self._table else None

    @property
    def signs(self) -> Optional[NDArray[np.str_]]:
        """The signs of both switching functions at each point, such as ``"+-"`` or ``"0+"`` (0: on
        the surface), shape (points,); None unless the switch is Filippov's and the system has two
        surfaces."""
        return self._table["signs"] if "signs" in self._table else None

    @property
    def piece(self) -> Optional[NDArray[np.int64]]:
        """Number of the piece of one mode to which each point belongs, shape (points,); None if the
        switch is not Filippov's."""
        return self._table["piece"] if "piece" in self._table else None


class Section(_Answer):
    """Passages through a plane: ``t`` (points,), ``y`` (states, points), ``direction``
    (points,)."""

    @property
    def direction(self) -> NDArray[np.int8]:
        """+1 where the coordinate grows through the plane's value, -1 where it falls; shape
        (points,)."""
        return np.where(self._table["direction"] == "up", np.int8(1), np.int8(-1))

    @property
    def up(self) -> NDArray[np.bool_]:
        """Whether the coordinate grows through the plane's value, shape (points,)."""
        return self._table["direction"] == "up"  # type: ignore[no-any-return]


class Future(_Points):
    """One future of a set-valued point: ``t`` (points,), ``y`` (states, points), ``mode``,
    ``events``."""

    exit_time: float
    """Time of repelling sliding before it leaves the surface."""
    side: str
    """To which side it leaves: "plus" or "minus"."""
    events: Table
    """What happened at the switching surface."""

    def __init__(
        self, system: System, table: Table, events: Table, exit_time: float, side: str
    ) -> None:
        super().__init__(system, table)
        self.events, self.exit_time, self.side = events, exit_time, side

    @property
    def mode(self) -> NDArray[np.str_]:
        """Where each point is, shape (points,)."""
        return self._table["mode"]

    def __repr__(self) -> str:
        return f"<twofold.Future leaving to {self.side} after {self.exit_time}: {len(self)} points>"


class Funnel(_Answer):
    """The approach to a set-valued point (``t``, ``y``, ``mode``), and its ``futures``."""

    futures: List[Future]
    """The computed members of the set, by exit time, plus before minus."""
    events: Table
    """What happened on the approach."""

    def __init__(
        self, system: System, table: Table, facts: _Facts, events: Table, futures: List[Future]
    ) -> None:
        super().__init__(system, table, facts)
        self.events, self.futures = events, futures

    @property
    def mode(self) -> NDArray[np.str_]:
        """Where each point of the approach is, shape (points,)."""
        return self._table["mode"]

    @property
    def point(self) -> Floats:
        """The set-valued point, shape (states,)."""
        return self.y_final


def _split(table: Table) -> List[Table]:
    """The rows of each member of a funnel: 0 is the approach."""
    numbers = table["future"]
    ends = np.searchsorted(
        numbers, np.arange(int(numbers[-1]) + 2) if len(numbers) else np.arange(2)
    )
    return [table._rows(slice(int(a), int(b))) for a, b in zip(ends[:-1], ends[1:])]


def _answer(
    system: System, spec: Dict[str, Any], progress: Progress
) -> Union[Solution, Section, Funnel]:
    with Shown(progress) as show:
        raw = _native.run(json.dumps(spec, allow_nan=False), show)
    tables = {name: Table(columns) for name, columns in raw["tables"].items()}
    statistics = json.loads(raw["statistics"]) or {}
    facts = _Facts(
        spec, raw["stop"], statistics, raw["hash"], raw["question"], json.loads(raw["facts"])
    )
    if "section" in tables:
        return Section(system, tables["section"], facts)
    if "path" in tables:
        return Solution(system, tables["path"], facts, None)
    motion, events = tables["motion"], tables["events"]
    if spec["switch"]["filippov"].get("funnel") is None:
        return Solution(system, motion, facts, events)
    members, happened = _split(motion), _split(events)
    happened += [events._rows(slice(0, 0))] * (len(members) - len(happened))
    futures = [
        Future(system, points, what, float(points["exit_time"][0]), str(points["exit_side"][0]))
        for points, what in zip(members[1:], happened[1:])
    ]
    return Funnel(system, members[0], facts, happened[0], futures)


# What is asked ------------------------------------------------------------------------------------


def solve(
    system: SystemLike,
    start: Optional[ArrayLike] = None,
    t_end: float = 150.0,
    *,
    switch: str = "smoothed",
    delay: Optional[float] = None,
    history: Optional[str] = None,
    band: Optional[float] = None,
    inside: Optional[str] = None,
    eps: Optional[float] = None,
    transition: Optional[str] = None,
    sigma: Optional[float] = None,
    eps_prime: Optional[float] = None,
    hysteresis: Optional[str] = None,
    exit: Optional[str] = None,
    plus_probability: Optional[float] = None,
    method: str = "dopri5",
    rtol: Optional[float] = None,
    atol: Optional[float] = None,
    max_step: Optional[float] = None,
    max_steps: Optional[int] = None,
    precision: Optional[int] = None,
    order: Optional[int] = None,
    restart: Optional[float] = None,
    kick_every: Optional[float] = None,
    kick_size: Optional[float] = None,
    kick_law: Optional[str] = None,
    seed: Optional[int] = None,
    stream: Optional[int] = None,
    chord: Optional[float] = None,
    every: Optional[float] = None,
    progress: Progress = False,
) -> Solution:
    """Integrates a system from t = 0 to ``t_end`` and records its path.

    Parameters
    ----------
    system : System or str or path
        The system, or a name or file of one.
    start : array_like, shape (states,), optional
        Initial state; without it the one that the system suggests.
    t_end : float
        Final time, in the system's unit of time.
    switch : {"smoothed", "hysteretic", "delayed", "relay", "filippov"}
        What stands in for the discontinuity at h = 0: a smooth transition of width ``eps``; a loop
        of half-width ``eps`` with a state of its own; a switch that acts late, on h(x(t - delay));
        a relay with memory, f+ until h falls to -band, then f- until it rises to band; or nothing:
        the discontinuous system, in Filippov's sense, event by event.
    delay : float
        Delay of a delayed switch, in units of time.
    history : {"constant", "flow"}
        Where the orbit was before the start of a run with a delayed switch: at the start, or on the
        orbit without delay that leads there [default "constant"].
    band : float
        Half the width of a relay's band, in units of h.
    inside : {"sign", "plus", "minus"}
        What a relay begins with where the start lies inside its band: f+ if h > 0 and f- otherwise,
        f+, or f- [default "sign"].
    eps : float
        Width of the layer, in units of h [default 1e-3; of a delayed switch none, which is the
        sharp rule].
    transition : {"tanh", "arctan", "algebraic", "erf"}
        Transition function of a smoothed switch, or of a delayed one with ``eps`` [default "tanh"].
    sigma : float
        Perturbs the tanh transition by sigma sqrt(eps) exp(-h^2).
    eps_prime : float
        Relaxation time of a hysteretic switch [default 10 eps].
    hysteresis : {"literal", "single"}
        How the hysteretic equation is read [default "literal"].
    exit : str
        How repelling sliding ends (Filippov): "at-once:SIDE", "after-time:T:SIDE",
        "after-arc:L:SIDE" with SIDE "plus" or "minus"; "random:exponential:MEAN" or
        "random:uniform:LONGEST". There is no default: the equations do not make this choice.
    plus_probability : float
        Probability of leaving to h > 0 under a random exit [default 0.5].
    method : {"dopri5", "lsoda", "radau5", "taylor", "taylor-extended", "layered"}
        Integration method. Filippov motion is integrated by dopri5, a sharp delayed switch and a
        relay by dopri5, taylor or taylor-extended, a smooth delayed switch by dopri5 or radau5.
    rtol, atol : float
        Tolerances of a step's local error [default 10^-7.97727, NDSolve's; 1e-32 for
        taylor-extended, or what ``precision`` allows]. From a start of states below 1e-3 the
        default ``atol`` is as many powers of ten smaller.
    max_step : float
        Longest step, in units of time [default a tenth of the time between restarts or kicks].
    max_steps : int
        Most steps before the run is given up [default 4e8].
    precision : {106, 192}
        Bits of taylor-extended's numbers [default 106, double-double].
    order : int
        Degree of taylor-extended's series, 4 to 1000 [default: what the tolerance asks for].
    restart : float
        Start the method afresh after each such interval of time.
    kick_every, kick_size, kick_law : float, float, {"sphere", "cube", "normal"}
        Perturb the state after each such interval, by so much [default eps], by this law [default
        "sphere"].
    seed, stream : int
        Of the random numbers of kicks and random exits (ChaCha8) [default 2013, 0].
    chord : float
        Largest distance between the recorded polyline and the dense output, in the states' units
        [default 1e-3].
    every : float
        Record at multiples of this time instead.
    progress : bool or callable
        True shows a line on standard error; a callable is given the share that is done and what is
        being computed.

    Returns
    -------
    Solution
        ``t`` (points,), ``y`` (states, points), ``message``, ``stop``, ``statistics``, ...

    Raises
    ------
    SpecError
        If an argument is wrong or would have no effect.
    ComputationError
        If the run could not be computed to its end.

    Notes
    -----
    Equal arguments give equal bits, on any machine and in the command line. The GIL is released;
    Ctrl-C stops the run.

    Examples
    --------
    >>> import twofold
    >>> run = twofold.solve("caricature", [0.2, 0, -1], 20.0)
    >>> run.y.shape == (3, len(run.t)), run.success
    (True, True)
    """
    options = {
        k: v
        for k, v in locals().items()
        if k not in ("system", "start", "t_end", "chord", "every", "progress")
    }
    system, question = _spec(system, start, t_end, _path(chord, every), **options)
    answer = _answer(system, question, progress)
    assert isinstance(answer, Solution)
    return answer


def section(
    system: SystemLike,
    start: Optional[ArrayLike] = None,
    t_end: float = 150.0,
    *,
    plane: Plane,
    progress: Progress = False,
    **options: Any,
) -> Section:
    """Integrates a system and records its crossings of a plane: a Poincaré section.

    Parameters
    ----------
    plane : str or (state, value)
        ``"y=0"`` or ``("y", 0.0)``.
    system, start, t_end, progress, **options
        As for :func:`solve`, without ``chord`` and ``every``.

    Returns
    -------
    Section
        ``t`` (points,), ``y`` (states, points), ``direction`` (points,): +1 upwards, -1 downwards.
    """
    system = as_system(system)
    system, question = _spec(system, start, t_end, _plane(system, plane), **options)
    answer = _answer(system, question, progress)
    assert isinstance(answer, Section)
    return answer


def funnel(
    system: SystemLike,
    start: Optional[ArrayLike] = None,
    t_end: float = 150.0,
    *,
    shortest: float = 0.05,
    longest: float = 2.0,
    times: int = 12,
    horizon: float = 50.0,
    until_two_fold: bool = True,
    progress: Progress = False,
    **options: Any,
) -> Funnel:
    """Follows the discontinuous system to the first point whose future is a set, and from there
    computes members of the set.

    Parameters
    ----------
    shortest, longest : float
        Shortest and longest time of repelling sliding, in units of time.
    times : int
        Number of such times between them, geometrically spaced; each is followed to both sides.
    horizon : float
        Follow each future so long at most.
    until_two_fold : bool
        End a future when it next comes to a two-fold.
    system, start, t_end, progress, **options
        As for :func:`solve`, without ``chord`` and ``every``: each step is recorded at fixed
        points; ``t_end`` ends the approach.

    Returns
    -------
    Funnel
        The approach (``t``, ``y``, ``mode``), the set-valued ``point`` and its ``futures``.

    Raises
    ------
    ComputationError
        If the run comes to no such point before ``t_end``.
    """
    grid = {
        "shortest": _finite("shortest", shortest),
        "longest": _finite("longest", longest),
        "times": _count("times", times),
        "horizon": _finite("horizon", horizon),
        "until_two_fold": bool(until_two_fold),
    }
    for name in ("switch", "exit"):
        _refuse(
            {name: options.get(name)}, "a funnel is of the discontinuous system, with every exit"
        )
    system, question = _spec(
        system, start, t_end, _path(None, None), grid, **{**options, "switch": "filippov"}
    )
    answer = _answer(system, question, progress)
    assert isinstance(answer, Funnel)
    return answer


def spec(
    system: SystemLike,
    start: Optional[ArrayLike] = None,
    t_end: float = 150.0,
    *,
    plane: Optional[Plane] = None,
    chord: Optional[float] = None,
    every: Optional[float] = None,
    **options: Any,
) -> Dict[str, Any]:
    """A run as data, computing nothing: what ``twofold run --print-spec`` prints. ``plane`` records
    crossings, else the path is recorded.

    The other arguments are those of :func:`solve`. See :func:`run_spec`.
    """
    system = as_system(system)
    if plane is None:
        observe: Any = _path(chord, every)
    else:
        _refuse(
            {"chord": chord, "every": every}, "crossings of a plane are recorded where they are"
        )
        observe = _plane(system, plane)
    return _spec(system, start, t_end, observe, **options)[1]


def _given(spec: Union[str, bytes, Mapping[str, Any]]) -> Tuple[System, Dict[str, Any]]:
    try:
        data = (
            json.loads(spec)
            if isinstance(spec, (str, bytes))
            else json.loads(json.dumps(spec, allow_nan=False))
        )
    except ValueError as error:
        raise SpecError(f"the spec is not JSON: {error}", "spec") from None
    if not isinstance(data, dict) or not isinstance(data.get("system"), dict):
        raise SpecError(
            "a spec is a JSON object with system, switch, start, t_end, method, schedule and "
            "observe",
            "spec",
        )
    return System.from_json(json.dumps(data["system"]), "spec"), data


def run_spec(
    spec: Union[str, bytes, Mapping[str, Any]], *, progress: Progress = False
) -> Union[Solution, Section, Funnel]:
    """Computes a run given as data: JSON text (``twofold run --print-spec``), or the same as a
    dict.

    Returns
    -------
    Solution, Section or Funnel
        By what the spec records.
    """
    return _answer(*_given(spec), progress)


def written(
    spec: Union[str, bytes, Mapping[str, Any]], format: str = "csv", *, progress: Progress = False
) -> bytes:
    """The very bytes that ``twofold run --spec SPEC --format FORMAT`` writes; ``format`` is "csv"
    or "json"."""
    _, data = _given(spec)
    with Shown(progress) as show:
        return bytes(_native.written(json.dumps(data, allow_nan=False), format, show))


# Outcomes of runs ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Classification:
    """What a run settles on."""

    name: str
    """"periodic", "spiralling", "quasi-periodic", "chaotic", "undecided", "noisy", "escaped" or
    "too-few"."""
    summary: str
    """The same in one line."""
    evidence: Dict[str, Any] = field(repr=False)
    """Everything that the verdict rests on, with the limits used."""

    @property
    def _cycle(self) -> Dict[str, Any]:
        verdict = self.evidence["verdict"]
        return (verdict.get("around") or {}) if self.name == "noisy" else verdict

    @property
    def end(self) -> str:
        """Which orbit the run ends on, whether or not it has arrived: "period 3", "chaotic", ..."""
        regular = self.name in ("periodic", "spiralling", "quasi-periodic")
        return f"period {self.period}" if regular else self.name

    @property
    def period(self) -> Optional[int]:
        """Points of one direction per turn of the closed orbit, if there is one."""
        return self._cycle.get("period")

    @property
    def captured_at(self) -> Optional[float]:
        """From this time on the run only turns around the closed orbit."""
        return self._cycle.get("captured_at")

    @property
    def settled_at(self) -> Optional[float]:
        """From this time on the run is on the closed orbit, as far as a picture shows."""
        return self._cycle.get("settled_at")

    @property
    def rate(self) -> Optional[float]:
        """Rate per unit time at which the distance from the closed orbit shrinks, where it could be
        fitted."""
        approach = self._cycle.get("approach")
        return None if approach is None else approach["per_time"]

    @property
    def exponent(self) -> Optional[float]:
        """The largest Lyapunov exponent per unit time, where it was computed."""
        exponent = self.evidence.get("lyapunov")
        return None if exponent is None else exponent["value"]


def _classification(evidence: Dict[str, Any]) -> Classification:
    return Classification(evidence["name"], evidence["summary"], evidence)


def classify(
    system: SystemLike,
    start: Optional[ArrayLike] = None,
    t_end: float = 150.0,
    *,
    plane: Plane,
    progress: Progress = False,
    **options: Any,
) -> Classification:
    """Says what a run settles on, judged from its crossings of a plane; systems of two states and
    more.

    The arguments are those of :func:`section`. A chaotic run's largest exponent is computed too.
    """
    question = spec(system, start, t_end, plane=plane, **options)
    with Shown(progress) as show:
        return _classification(
            json.loads(_native.classify(json.dumps(question, allow_nan=False), show))
        )


class Sweep:
    """Where many runs end: a row a run, in order."""

    table: Table
    """The rows: first what was varied, then ``outcome``, ``period``, ``captured_at``,
    ``settled_at``, ``radius``, ``rate``, ``turn``, ``exponent``, ``exponent_error``,
    ``crossings``, ``end``, ``steps``, ``reason``. NaN where there is nothing to say. Times are in
    the system's unit of time, rates and exponents per unit of time."""
    csv: Optional[bytes]
    """The same as the very bytes that ``twofold sweep --out FILE.csv`` writes; None for runs from a
    list of starts."""

    def __init__(self, table: Table, csv: Optional[bytes]) -> None:
        self.table, self.csv = table, csv

    @property
    def ends(self) -> List[str]:
        """Where each run ends: "rest", "period-1", "leaving-period-1", "quasi-periodic",
        "irregular", "undecided", "noisy", "noisy-around-period-1", "far", "escaped", "too-few" or
        "failed"."""
        return [str(word) for word in self.table["outcome"]]

    @property
    def counts(self) -> Dict[str, int]:
        """How often each end occurred, the most frequent first."""
        return dict(sorted(Counter(self.ends).items(), key=lambda kv: (-kv[1], kv[0])))

    @property
    def errors(self) -> List[Optional[str]]:
        """Why a run failed; None where it did not. A run that fails stops no other."""
        return [str(reason) or None for reason in self.table["reason"]]

    def __len__(self) -> int:
        return self.table.rows

    def __repr__(self) -> str:
        counts = ", ".join(f"{end}: {n}" for end, n in self.counts.items())
        return f"<twofold.Sweep of {len(self)} runs; {counts}>"


def shifted(start: ArrayLike, runs: int, shift: float, state: int = 0) -> Floats:
    """Starts that differ by almost nothing: ``start`` with one state shifted by ``shift``, twice
    ``shift``, ...; shape (runs, states).

    These are the starts of ``twofold sweep --runs RUNS --shift SHIFT``, and of
    ``over="shift.x=SHIFT*RUNS"``.
    """
    starts = np.tile(np.asarray(start, dtype=np.float64), (_count("runs", runs), 1))
    starts[:, state] += np.arange(1, runs + 1) * float(shift)
    return starts


_OUTCOME = {
    "outcome": "", "period": 0, "captured_at": None, "settled_at": None, "radius": None,
    "rate": None, "turn": None, "exponent": None, "exponent_error": None,
    "crossings": 0, "end": None, "steps": 0, "reason": "",
}  # fmt: skip


def _outcomes(names: Sequence[str], starts: Floats, rows: Sequence[Dict[str, Any]]) -> Table:
    """The rows of a list of starts, in the columns of a sweep."""
    found: List[Dict[str, Any]] = []
    for row in rows:
        outcome = row.get("outcome")
        if outcome is None:
            found.append({**_OUTCOME, "outcome": "failed", "reason": row["error"]})
        else:
            found.append(
                {
                    **_OUTCOME,
                    **{k: v for k, v in outcome.items() if k != "word"},
                    "outcome": outcome["word"],
                }
            )
    columns: Dict[str, Any] = {
        f"start.{name}": np.ascontiguousarray(starts[:, i]) for i, name in enumerate(names)
    }
    for name, usual in _OUTCOME.items():
        values = [row[name] for row in found]
        if usual is None:
            columns[name] = np.array([np.nan if v is None else v for v in values], dtype=np.float64)
        else:
            columns[name] = np.array(values, dtype=np.int64 if usual == 0 else np.str_)
    return Table(columns)


def sweep(
    system: SystemLike,
    start: Optional[ArrayLike] = None,
    t_end: float = 150.0,
    *,
    plane: Plane,
    over: Union[str, Sequence[str], None] = None,
    random: Optional[int] = None,
    random_seed: Optional[int] = None,
    threads: int = 0,
    progress: Progress = False,
    **options: Any,
) -> Sweep:
    """Varies any number of a run, or takes many starts, and says where each run ends. Runs are
    computed side by side.

    Parameters
    ----------
    start : array_like
        Shape (runs, states): a run from each of these starts (see :func:`shifted`). Shape
        (states,), or nothing: one start, and ``over`` says what varies.
    over : list of str
        What varies, as ``twofold sweep --over`` has it: ``"params.alpha=0.1,0.2"``,
        ``"interval=20,40,100"`` (between restarts), ``"shift.x=1e-9*40"``,
        ``"eps=1e-4..1e-2:log:20"``; ``"start.x=-1..1"`` is drawn at random. All combinations are
        computed, the last axis fastest.
    random, random_seed : int
        How often random axes are drawn, and the seed of the draws [default 2013].
    threads : int
        Threads; 0 is one a core. The answers do not depend on it.
    system, t_end, plane, progress, **options
        As for :func:`section`. Random kicks and exits have a stream of their own in every run.

    Returns
    -------
    Sweep
        ``table`` (a row a run), ``ends``, ``counts``, ``errors``.

    Examples
    --------
    >>> import twofold
    >>> over = ["interval=5,10", "shift.x=1e-9*2"]
    >>> twofold.sweep("caricature", None, 20.0, plane="y=0", over=over).counts
    {'too-few': 4}
    """
    system = as_system(system)
    given = None if start is None else np.asarray(start, dtype=np.float64)
    workers = _count("threads", threads)
    if given is None or given.ndim == 1:
        if over is None:
            raise SpecError("give over: what varies; or starts of the shape (runs, states)", "over")
        if random is None:
            _refuse(
                {"random_seed": random_seed},
                "nothing is drawn at random; give random, the number of draws",
            )
        draws = (
            None
            if random is None
            else (
                _count("random", random),
                2013 if random_seed is None else _count("random_seed", random_seed),
            )
        )
        question = json.dumps(spec(system, given, t_end, plane=plane, **options), allow_nan=False)
        with Shown(progress) as show:
            columns, csv = _native.sweep(
                question, [over] if isinstance(over, str) else list(over), draws, workers, show
            )
        return Sweep(Table(columns), bytes(csv))
    _refuse(
        {"over": over, "random": random, "random_seed": random_seed}, "the starts say what varies"
    )
    if given.ndim != 2 or len(given) == 0:
        raise SpecError(
            f"the starts have the shape {given.shape}: give (runs, states), a run at least", "start"
        )
    question = json.dumps(spec(system, given[0], t_end, plane=plane, **options), allow_nan=False)
    with Shown(progress) as show:
        rows = _native.fates(question, given.tolist(), workers, show)
    return Sweep(_outcomes(system.states, given, [json.loads(row) for row in rows]), None)
