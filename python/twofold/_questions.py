"""What commands of ``twofold`` compute, asked from Python with the commands' own flags and
defaults."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any, Callable, Iterable, List, Mapping, Sequence, TypeVar, Union

import numpy as np

from . import _native
from ._folder import Answer
from ._progress import Shown
from ._runs import Progress, Sweep, Table
from ._system import System

SystemLike = Union[System, str, "os.PathLike[str]"]
Values = Union[str, Sequence[float]]
T = TypeVar("T")

__all__ = ["follow", "lyapunov", "orbit", "outcomes", "rests", "scan", "sensitivities"]


def _one(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, (bool, np.bool_)):
        raise TypeError("true and false stand alone; give a number or a text")
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    return repr(float(value))


def _is_list(value: Any) -> bool:
    return isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping))


def _flags(given: Mapping[str, Any]) -> List[str]:
    """Keyword arguments as a command's flags: ``t_end=10`` is ``--t-end=10``, a list is joined by
    commas, and what is named (``params``, ``within``, ``over``) is given once a name."""
    flags: List[str] = []
    for key, value in given.items():
        name = "set" if key == "params" else key.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            flags.append(f"--{name}")
        elif isinstance(value, Mapping):
            for of, item in value.items():
                text = ",".join(map(_one, item)) if _is_list(item) else _one(item)
                if name == "within" and _is_list(item):
                    text = "..".join(map(_one, item))
                flags.append(f"--{name}={of}={text}")
        elif _is_list(value):
            flags.append(f"--{name}=" + ",".join(map(_one, value)))
        else:
            flags.append(f"--{name}={_one(value)}")
    return flags


def _ask(
    command: str, system: SystemLike, given: Mapping[str, Any], progress: Progress, threads: int = 0
) -> Answer:
    def asked(flags: List[str]) -> Answer:
        with Shown(progress) as show:
            return Answer(_native.ask(command, flags, threads, show))

    return _asked(system, given, asked)


def _is_text(system: str) -> bool:
    """Whether this is the text of a system, TOML or JSON, rather than a name or a file's."""
    if os.path.isfile(system):
        return False
    return "\n" in system or "=" in system or system.lstrip().startswith("{")


def _asked(system: SystemLike, given: Mapping[str, Any], ask: Callable[[List[str]], T]) -> T:
    """The answer to a command's flags, those of its system among them."""
    if not isinstance(system, (System, str, os.PathLike)):
        raise TypeError(
            f"the system is {system!r}: give a name, a file, the text of one, or a System"
        )
    with tempfile.TemporaryDirectory() as folder:
        flags = _flags(given)
        if isinstance(system, System) or (isinstance(system, str) and _is_text(system)):
            text = system.to_toml() if isinstance(system, System) else system
            json = text.lstrip().startswith("{")
            file = Path(folder) / ("system.json" if json else "system.toml")
            file.write_text(text, encoding="utf-8")
            name = str(file)
            if isinstance(system, System):
                flags = [
                    f"--set={parameter}={value!r}" for parameter, value in system.parameters.items()
                ] + flags
        else:
            name = os.fspath(system)
        return ask([f"--system={name}", *flags])


def follow(system: SystemLike, *, progress: Progress = False, **flags: Any) -> Answer:
    """Follows a general system from switch to switch, as ``twofold run`` does: the table ``path``,
    or ``section`` with ``section="x=0"``.

    Parameters
    ----------
    system : System, str or path
        A built-in system's name, a file, the text of one, or a :class:`System`. General systems
        (``f``, events, modes, tables) and those with h, plus and minus alike.
    params : dict of str to number, optional
        Values of parameters.
    **flags
        The flags of ``twofold run`` with underscores for dashes, and its defaults: ``t_end=10``,
        ``start=[1, 0]``, ``rtol=1e-12``, ``every=0.1`` ...

    Raises
    ------
    SpecError
        If the system or a flag is wrong, or a flag has no effect.
    ComputationError
        If motion is not decided, or cannot be followed.

    Examples
    --------
    >>> import twofold
    >>> ball = twofold.follow("bouncing-ball", t_end=1.0)
    >>> sorted(ball.tables["path"])
    ['event', 't', 'v', 'x']
    """
    return _ask("run", system, flags, progress)


def orbit(system: SystemLike, *, progress: Progress = False, **flags: Any) -> Answer:
    """A closed orbit and its Floquet multipliers, as ``twofold orbit`` finds it: facts ``period``,
    ``point``, ``multipliers`` (real and imaginary parts).

    ``**flags`` are those of the command, and its defaults: ``section="x=0"``, ``period=1``,
    ``settle=100``, ``along="p=0..1"`` ... See :func:`follow` for ``system``, ``params`` and the
    errors.

    >>> import twofold
    >>> walker = twofold.orbit("rimless-wheel", section="a=0")
    >>> 0 < walker.facts["multipliers"][0][0] < 1
    True
    """
    return _ask("orbit", system, flags, progress)


def lyapunov(system: SystemLike, *, progress: Progress = False, **flags: Any) -> Answer:
    """Lyapunov exponents per unit time, as ``twofold lyapunov`` computes them. Of general systems
    and of ``switch="filippov"`` the fact ``exponents``: a list of ``{"value": ..., "half_width":
    ...}``, largest first, ``value`` None where sliding takes the direction away; of other switches
    the facts ``exponent`` and ``half_width`` of the largest. Half-widths are those of 95 %
    intervals.

    >>> import twofold
    >>> found = twofold.lyapunov("sliding-mode-control", t_end=60).facts["exponents"]
    >>> found[0]["value"] < 0
    True
    """
    return _ask("lyapunov", system, flags, progress)


def rests(system: SystemLike, **flags: Any) -> Answer:
    """Equilibria and pseudo-equilibria in a box, as ``twofold rests`` finds them: the fact
    ``rests``, with states, eigenvalues and stability.

    ``within={"x": (-3, 3)}`` bounds states; the others go from -10 to 10.

    >>> import twofold
    >>> [rest["state"] for rest in twofold.rests("states = ['x']\\nf = ['1 - x']").facts["rests"]]
    [[1.0]]
    """
    return _ask("rests", system, flags, False)


def scan(
    system: SystemLike,
    over: Mapping[str, Values],
    *,
    threads: int = 0,
    progress: Progress = False,
    **flags: Any,
) -> Answer:
    """What runs do as one or two settings vary, as ``twofold scan`` has it: the table ``passages``
    (over one setting), or ``endings`` (over two).

    ``over={"params.input": "20..32:60"}``, or a list of numbers; ``section="x=0"`` or ``period=1``
    says where runs are looked at, ``follow="both"`` follows an attractor up and down. Facts:
    ``runs``, ``failed`` and ``first_error``: a run that fails leaves a gap. ``threads`` = 0 is one
    per core; rows do not depend on it.

    >>> import twofold
    >>> found = twofold.scan("impact-oscillator", {"params.w": [2.0, 2.1]}, section="v=0", t_end=40)
    >>> found.facts["runs"]
    2
    """
    return _ask("scan", system, {"over": over, **flags}, progress, threads)


def outcomes(
    system: SystemLike,
    over: Mapping[str, Values],
    *,
    threads: int = 0,
    progress: Progress = False,
    **flags: Any,
) -> Sweep:
    """Where each of many runs of any system ends, as ``twofold sweep`` has it: a row for every
    combination of what is varied, the last axis fastest.

    ``over={"params.belt": "0.1..1:10", "start.x": [0, 1]}``; ``section="x=0"`` or ``period=1`` says
    where runs are looked at; ``random=100`` draws ``"start.x": "-1..1"``. See :func:`follow` for
    ``system``, ``params`` and the errors, :func:`sweep` for lists of starts.

    >>> import twofold
    >>> text = "states = ['x', 'v']\\nstart = [1, 0]\\nf = ['v', '-x-k*v']\\nparameters = { k = 1 }"
    >>> twofold.outcomes(text, {"params.k": [1, 2]}, section="v=0", t_end=50).ends
    ['rest', 'rest']
    """

    def asked(given: List[str]) -> Sweep:
        with Shown(progress) as show:
            columns, csv = _native.outcomes(given, threads, show)
        return Sweep(Table(columns), bytes(csv))

    return _asked(system, {"over": over, **flags}, asked)


def sensitivities(system: SystemLike, *, progress: Progress = False, **flags: Any) -> Answer:
    """Derivatives of the state at ``t_end`` by the start and by parameters, through switches,
    slides and resets, as ``twofold sensitivities`` computes them.

    The table ``sensitivities`` has a row a state: ``state``, ``value``, ``start.x`` ...,
    ``params.p`` ...; ``by=["p"]`` chooses parameters.

    >>> import twofold
    >>> text = "states = ['x']\\nstart = [1]\\nf = ['-k*x']\\n[parameters]\\nk = 2"
    >>> table = twofold.sensitivities(text, t_end=1.0).tables["sensitivities"]
    >>> bool(abs(table["params.k"][0] + table["value"][0]) < 1e-9)
    True
    """
    return _ask("sensitivities", system, flags, progress)
