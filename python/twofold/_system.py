"""Piecewise-smooth systems."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .errors import DefinitionError

Number = Union[int, float, str]
"""A number, or its digits as a string: digits beyond double precision are used by
``method="taylor-extended"``."""

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def _text(value: str) -> str:
    """A TOML string. What JSON escapes, TOML reads."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _number(value: object, of: str) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return str(int(value))
    try:
        return repr(float(value))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise TypeError(f"{of}: give a number, or its digits as a string, not {value!r}") from None


def _texts(key: str, values: Sequence[str]) -> str:
    if isinstance(values, str):
        raise TypeError(f"{key} is a list of strings; put [...] around it")
    return f"{key} = [{', '.join(_text(v) for v in values)}]\n"


def _toml(
    states: Sequence[Union[str, Mapping[str, str]]],
    h: str,
    plus: Sequence[str],
    minus: Sequence[str],
    second: Optional[Mapping[str, Any]],
    parameters: Mapping[str, Union[Number, Mapping[str, Any]]],
    let: Mapping[str, str],
    start: Optional[Sequence[Number]],
    axes: Sequence[str],
    references: Sequence[str],
    words: Mapping[str, str],
) -> str:
    def table(entries: Mapping[str, Any], of: str) -> str:
        def value(key: str, given: Any) -> str:
            return _text(given) if key in ("name", "meaning", "unit") else _number(given, of)

        return "{ " + ", ".join(f"{_key(k)} = {value(k, v)}" for k, v in entries.items()) + " }"

    if isinstance(states, str):
        raise TypeError('states is a list of names, such as ["x", "v"]')
    text = "".join(f"{key} = {_text(word)}\n" for key, word in words.items() if word)
    if references:
        text += _texts("references", references)
    text += (
        "states = ["
        + ", ".join(_text(s) if isinstance(s, str) else table(s, "states") for s in states)
        + "]\n"
    )
    if start is not None:
        text += "start = [" + ", ".join(_number(x, "start") for x in start) + "]\n"
    if axes:
        text += _texts("axes", axes)
    text += f"h = {_text(h)}\n" + _texts("plus", plus) + _texts("minus", minus)
    if second is not None:
        unknown = set(second) ^ {"h", "plus", "minus"}
        if unknown:
            raise TypeError(
                f'second is {{"h": "...", "plus": [...], "minus": [...]}}: look at '
                f'{sorted(unknown)}'
            )
        text += (
            f"[second]\nh = {_text(second['h'])}\n"
            + _texts("plus", second["plus"])
            + _texts("minus", second["minus"])
        )
    if parameters:
        text += "[parameters]\n"
        for name, value in parameters.items():
            text += (
                f"{_key(name)} = "
                f"{table(value, name) if isinstance(value, Mapping) else _number(value, name)}\n"
            )
    if let:
        text += "[let]\n" + "".join(f"{_key(name)} = {_text(term)}\n" for name, term in let.items())
    return text


class System:
    """A piecewise-smooth system x' = f+(x) where h(x) > 0, x' = f-(x) where h(x) < 0.

    One of:

    - ``System("caricature")``: a built-in one (see :func:`builtin_systems`);
    - ``System("my.toml")``, ``System(pathlib.Path(...))``: a file, TOML or JSON;
    - ``System(text)``: the text of such a file;
    - ``System(states=[...], h="...", plus=[...], minus=[...], parameters={...})``: expressions.

    Expressions have ``+ - * / ^``, parentheses, and the functions that the file format knows
    (``docs/python.md``). Where one is wrong, :class:`twofold.DefinitionError` points to it.

    Parameters
    ----------
    source : str or path, optional
        A name, a file, or a text; then nothing else is given.
    states : list of str
        The states' names, in order; ``{"name": "x", "meaning": "...", "unit": "..."}`` says more.
    h : str
        The switching function.
    plus, minus : list of str
        The vector fields where h > 0 and where h < 0: one expression a state, the derivatives.
    second : dict, optional
        A second switching surface, ``{"h": "...", "plus": [...], "minus": [...]}``: ``plus`` and
        ``minus`` above then hold where its h is positive, its own where that is negative.
    parameters : dict of str to number, optional
        ``{"alpha": 0.1}``, ``{"alpha": "0.1000000000000000000001"}`` or ``{"alpha": {"value": 0.1,
        "meaning": "...", "unit": "..."}}``.
    let : dict of str to str, optional
        Intermediate terms, in any order.
    start : list of numbers, optional
        A suggested initial state.
    axes : list of str, optional
        Which states a picture shows.
    name, title, about : str, optional
    references : list of str, optional

    Raises
    ------
    DefinitionError
        If the definition is wrong.
    OSError
        If the file cannot be read.

    Notes
    -----
    Systems are values: they do not change, and are equal if their definitions (texts included) and
    parameters are.

    Examples
    --------
    >>> import twofold
    >>> block = twofold.System(
    ...     states=["x", "v"], h="v - belt",
    ...     plus=["v", "-x - friction"], minus=["v", "-x + friction"],
    ...     parameters={"belt": 0.3, "friction": 1},
    ... )
    >>> block.with_(friction=0.5).parameters
    {'belt': 0.3, 'friction': 0.5}
    """

    __slots__ = ("_definition",)
    _definition: _native.Definition

    def __init__(
        self,
        source: Union[str, "os.PathLike[str]", None] = None,
        *,
        states: Optional[Sequence[Union[str, Mapping[str, str]]]] = None,
        h: Optional[str] = None,
        plus: Optional[Sequence[str]] = None,
        minus: Optional[Sequence[str]] = None,
        second: Optional[Mapping[str, Any]] = None,
        parameters: Optional[Mapping[str, Union[Number, Mapping[str, Any]]]] = None,
        let: Optional[Mapping[str, str]] = None,
        start: Optional[Sequence[Number]] = None,
        axes: Sequence[str] = (),
        name: str = "",
        title: str = "",
        about: str = "",
        references: Sequence[str] = (),
    ) -> None:
        if source is None:
            if states is None or h is None or plus is None or minus is None:
                raise TypeError(
                    "give a name, a file or a text, or else states=, h=, plus= and minus="
                )
            words = {"name": name, "title": title, "about": about}
            text = _toml(
                states,
                h,
                plus,
                minus,
                second,
                parameters or {},
                let or {},
                start,
                axes,
                references,
                words,
            )
            self._definition = _native.Definition.from_toml(text, "<expressions>")
            return
        others = (
            states,
            h,
            plus,
            minus,
            second,
            parameters,
            let,
            start,
            axes,
            name,
            title,
            about,
            references,
        )
        if any(other is not None and len(other) > 0 for other in others):
            raise TypeError(
                "a name, a file or a text says everything: leave the other arguments out, or use "
                "with_(...)"
            )
        self._definition = _native_from(source)

    @classmethod
    def _of(cls, native: _native.Definition) -> System:
        system = cls.__new__(cls)
        system._definition = native
        return system

    @classmethod
    def from_toml(cls, text: str, origin: str = "<text>") -> System:
        """Reads the text of a TOML file; ``origin`` names it in errors."""
        return cls._of(_native.Definition.from_toml(text, origin))

    @classmethod
    def from_json(cls, text: str, origin: str = "<text>") -> System:
        """Reads JSON: what :meth:`to_json` writes, or a whole definition."""
        return cls._of(_native.Definition.from_json(text, origin))

    @classmethod
    def from_file(cls, path: Union[str, "os.PathLike[str]"]) -> System:
        """Reads a file; JSON if its name ends in ``.json``, else TOML."""
        path = Path(path)
        text = path.read_text(encoding="utf-8")
        return (
            cls.from_json(text, str(path))
            if path.suffix.lower() == ".json"
            else cls.from_toml(text, str(path))
        )

    def with_(self, **parameters: Number) -> System:
        """The same system with other values of some parameters: ``system.with_(alpha=0.2)``.

        Raises
        ------
        ParameterError
            If there is no such parameter, or the value is not finite.
        """
        return System._of(self._definition.with_values(list(parameters.items())))

    @property
    def name(self) -> str:
        """The name; empty if there is none."""
        return self._definition.name

    @property
    def title(self) -> str:
        """One line about the system."""
        return self._definition.title

    @property
    def about(self) -> str:
        """More about the system."""
        return self._definition.about

    @property
    def references(self) -> List[str]:
        """Where the system comes from."""
        return self._definition.references

    @property
    def states(self) -> Tuple[str, ...]:
        """The states' names, in order."""
        return tuple(name for name, _, _ in self._definition.states)

    @property
    def parameters(self) -> Dict[str, float]:
        """The parameters' values."""
        return {name: value for name, value, _, _, _ in self._definition.parameters}

    @property
    def meanings(self) -> Dict[str, str]:
        """What states and parameters are, where the definition says so, with their units."""
        rows = [(n, m, u) for n, m, u in self._definition.states] + [
            (n, m, u) for n, _, _, m, u in self._definition.parameters
        ]
        return {n: f"{m} [{u}]" if u else m for n, m, u in rows if m or u}

    @property
    def start(self) -> Optional[NDArray[np.float64]]:
        """The suggested initial state, shape (states,); None if the definition suggests none."""
        start = self._definition.start
        return None if start is None else np.array(start)

    @property
    def h(self) -> str:
        """The switching function."""
        return self._definition.h

    @property
    def plus(self) -> List[str]:
        """f+, component by component."""
        return self._definition.plus

    @property
    def minus(self) -> List[str]:
        """f-, component by component."""
        return self._definition.minus

    def evaluate(self, x: ArrayLike) -> Tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """h, f+ and f- at the point ``x``, shape (states,): a number and two arrays of that
        shape."""
        return self._definition.evaluate(np.ascontiguousarray(x, dtype=np.float64))

    def to_toml(self) -> str:
        """The definition as a file, with the values that it gives to parameters; values set by
        :meth:`with_` are not in it."""
        return self._definition.to_toml()

    def to_json(self) -> str:
        """What decides the system's numbers, and its name, as JSON: this is part of a spec."""
        return self._definition.to_json()

    def __eq__(self, other: object) -> bool:
        return (
            self._definition == other._definition if isinstance(other, System) else NotImplemented
        )

    def __hash__(self) -> int:
        return hash(self.to_json())

    def __reduce__(self) -> Tuple[Any, ...]:
        return (
            _restored,
            (
                self._definition.to_toml(),
                [(name, digits) for name, _, digits, _, _ in self._definition.parameters],
            ),
        )

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name}={digits}" for name, _, digits, _, _ in self._definition.parameters
        )
        return (f"<twofold.System {self.name or 'without name'}: "
                f"{', '.join(self.states)}{'; ' + values if values else ''}>")


def _restored(definition: str, values: List[Tuple[str, str]]) -> System:
    return System.from_toml(definition).with_(**dict(values))


def _native_from(source: Union[str, "os.PathLike[str]"]) -> _native.Definition:
    if not isinstance(source, str):
        return System.from_file(source)._definition
    if source.lstrip().startswith("{"):
        return _native.Definition.from_json(source, "<text>")
    if "\n" in source or "=" in source:
        return _native.Definition.from_toml(source, "<text>")
    if source.lower().endswith((".toml", ".json")) or os.path.isfile(source):
        return System.from_file(source)._definition
    return _native.Definition.builtin(source)


def builtin_systems() -> List[str]:
    """The names of the built-in systems: each may be given to :class:`System`."""
    return _native.builtin_names()


def as_system(system: Union[System, str, "os.PathLike[str]"]) -> System:
    """A system from whatever stands for one."""
    if isinstance(system, System):
        return system
    if isinstance(system, (str, os.PathLike)):
        return System(system)
    raise TypeError(f"system: give a twofold.System, a name or a file, not {type(system).__name__}")


__all__ = ["System", "builtin_systems", "DefinitionError"]
