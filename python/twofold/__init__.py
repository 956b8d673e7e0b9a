"""Piecewise-smooth dynamical systems, integrated with the same bytes on any machine.

A piecewise-smooth system is x' = f+(x) where h(x) > 0 and x' = f-(x) where h(x) < 0. What happens
at h = 0 is a matter of modelling: a smooth transition, a hysteretic one, or the discontinuous
system itself in Filippov's sense, whose future at a two-fold is a set.

=============================== ====================================================================
:class:`System`                 a system: built in, from a file, or from expressions
:func:`solve`                   its path from a start: ``t``, ``y`` as SciPy has them
:func:`section`                 its crossings of a plane (a Poincaré section)
:func:`funnel`                  the futures of a point whose future is a set
:func:`classify`                what a run settles on
:func:`sweep`                   what runs from many starts settle on, side by side
:func:`follow`                  a general system's motion: events, modes, tables, several surfaces
:func:`orbit`                   a closed orbit and its Floquet multipliers
:func:`lyapunov`                Lyapunov exponents with their intervals
:func:`rests`                   equilibria and pseudo-equilibria
:func:`scan`                    an orbit diagram over one setting, or a map of endings over two
:func:`outcomes`                where each of many runs of any system ends
:func:`sensitivities`           derivatives of a run's end by its start and parameters
:func:`spec`, :func:`run_spec`  a run as data, as ``twofold run --spec`` reads it
:func:`panels`                  the panels of the paper's figures, as runs with their hashes
:func:`verdicts`                whether the paper's claims hold
:class:`Paper`                  any paper as a folder: figures, claims, answers
=============================== ====================================================================

Units are the system's own: the built-in systems are dimensionless. Arrays are float64; ``y`` has
the shape (states, points). Errors derive from :class:`TwofoldError` (see :mod:`twofold.errors`).
Computations release the GIL, can be interrupted by Ctrl-C, and say how far they have come with
``progress=True``.

>>> import twofold
>>> len(twofold.section("caricature", [0.2, 0, -1], 20.0, plane="y=0")) >= 3
True
"""

from . import errors
from ._native import NUMERICS as _NUMERICS, VERSION as __version__
from ._folder import Answer, Claim, Figure, Paper
from ._paper import Panel, Verdict, panels, verdict_table, verdicts
from ._questions import follow, lyapunov, orbit, outcomes, rests, scan, sensitivities
from ._runs import (
    Classification,
    Funnel,
    Future,
    Section,
    Solution,
    Sweep,
    Table,
    classify,
    funnel,
    run_spec,
    section,
    shifted,
    solve,
    spec,
    sweep,
    written,
)
from ._system import System, builtin_systems
from .errors import (
    ComputationError,
    DefinitionError,
    InternalError,
    ParameterError,
    SpecError,
    TwofoldError,
)

numerics: str = _NUMERICS
"""Digest of the sources that numbers depend on: equal digests give equal bits."""

__all__ = [
    "Answer",
    "Claim",
    "Classification",
    "ComputationError",
    "DefinitionError",
    "Figure",
    "Funnel",
    "Future",
    "InternalError",
    "Panel",
    "Paper",
    "ParameterError",
    "Section",
    "Solution",
    "SpecError",
    "Sweep",
    "System",
    "Table",
    "TwofoldError",
    "Verdict",
    "__version__",
    "builtin_systems",
    "classify",
    "errors",
    "follow",
    "funnel",
    "lyapunov",
    "numerics",
    "orbit",
    "outcomes",
    "panels",
    "rests",
    "run_spec",
    "scan",
    "section",
    "sensitivities",
    "shifted",
    "solve",
    "spec",
    "sweep",
    "verdict_table",
    "verdicts",
    "written",
]
