"""The errors of :mod:`twofold`. All derive from :class:`TwofoldError`.

==================== ================== ============================================================
class                is also a          means
==================== ================== ============================================================
``DefinitionError``  ``ValueError``     a system's definition is wrong: where, and what to do
``ParameterError``   ``ValueError``     no such parameter, or no such value
``SpecError``        ``ValueError``     a run's argument is wrong, or has no effect on this run
``ComputationError`` ``RuntimeError``   the run was sound, but could not be computed to its end
``InternalError``    ``RuntimeError``   a defect of the library: please report it
==================== ================== ============================================================

Ctrl-C raises :class:`KeyboardInterrupt`, as everywhere.
"""

from __future__ import annotations

from typing import Optional

__all__ = [
    "TwofoldError",
    "DefinitionError",
    "ParameterError",
    "SpecError",
    "ComputationError",
    "InternalError",
]


class TwofoldError(Exception):
    """What every error of this package is."""


class DefinitionError(TwofoldError, ValueError):
    """A system's definition is wrong. Its text shows the place::

        unknown name `alhpa`
          --> <expressions>:3:14
          |
        3 | plus = ["1 + alhpa*x", "y"]
          |              ^^^^^
          = help: did you mean `alpha`?
    """

    message: str
    """What is wrong, in one line."""
    origin: Optional[str]
    """The file's name, or ``<expressions>`` for a system given as arguments; None if no place is
    known."""
    line: Optional[int]
    """Line in the text, from 1."""
    column: Optional[int]
    """Column in characters, from 1."""
    help: Optional[str]
    """What to do."""

    def __init__(
        self,
        text: str,
        message: Optional[str] = None,
        origin: Optional[str] = None,
        line: Optional[int] = None,
        column: Optional[int] = None,
        help: Optional[str] = None,
    ) -> None:
        super().__init__(text)
        self.message = text if message is None else message
        self.origin = origin
        self.line = line
        self.column = column
        self.help = help


class ParameterError(TwofoldError, ValueError):
    """The system has no parameter of this name, or the value is not a finite number."""

    parameter: str
    """The parameter's name."""

    def __init__(self, text: str, parameter: str = "") -> None:
        super().__init__(text)
        self.parameter = parameter


class SpecError(TwofoldError, ValueError):
    """An argument of a run is wrong, or would have no effect on this run: nothing is ignored
    silently."""

    field: str
    """The argument's name."""

    def __init__(self, text: str, field: str = "") -> None:
        super().__init__(text)
        self.field = field


class ComputationError(TwofoldError, RuntimeError):
    """The computation could not be carried out: the step size fell to nothing, the budget of steps
    was used up, the orbit escaped, a point was reached where the rules say nothing, or more points
    came than are kept."""


class InternalError(TwofoldError, RuntimeError):
    """A defect of the library. Please report it with the call that led to it."""
