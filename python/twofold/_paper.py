"""The figures of Jeffrey (2013): what their panels ask, and what was published with this version.
Any other paper is a :class:`twofold.Paper`."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional

from . import _native
from ._system import System
from .errors import SpecError

__all__ = ["Panel", "Verdict", "panels", "verdicts", "verdict_table"]


@dataclass(frozen=True)
class Verdict:
    """Whether a claim of the paper holds in one panel."""

    figure: str
    """"fig7"."""
    panel: str
    """"iii"."""
    reading: Optional[str]
    """How the paper's parameters are read, by a name of its folder; None without readings."""
    claim: str
    """What the paper says."""
    found: str
    """What our run shows."""
    agrees: bool
    """Whether the two agree, by the rules of the library."""
    because: str = ""
    """Why, or with what reservation; verdicts that were published have none."""


@dataclass(frozen=True)
class Panel:
    """A panel of a figure: a run, and the hash that its answer must have."""

    figure: str
    """"fig7"."""
    panel: str
    """"iii"."""
    reading: Optional[str]
    """How the paper's parameters are read; None where a figure has no readings."""
    title: str
    """A few words."""
    spec: Dict[str, Any] = field(repr=False)
    """The run, for :func:`twofold.run_spec`."""
    hash: Optional[str] = field(repr=False)
    """The hash that the answer must have (``answer.hash``)."""
    verdict: Optional[Verdict]
    """The published verdict, where the paper claims something."""

    @property
    def system(self) -> System:
        """The panel's system."""
        return System.from_json(json.dumps(self.spec["system"]))


def panels(figure: Optional[str] = None, reading: Optional[str] = None) -> List[Panel]:
    """The panels that are made of runs, in the paper's order; of one figure or one reading, if
    given."""
    found = []
    rows = json.loads(_native.panels())
    for key, asked in (("figure", figure), ("reading", reading)):
        known = list(dict.fromkeys(row[key] for row in rows))
        if asked is not None and asked not in known:
            raise SpecError(f"there is no {key} {asked!r}; choose one of {', '.join(known)}", key)
    for row in rows:
        if figure not in (None, row["figure"]) or reading not in (None, row["reading"]):
            continue
        verdict = row["verdict"] and Verdict(
            row["figure"], row["panel"], row["reading"], **row["verdict"]
        )
        title = row["panel_title"] or row["title"]
        found.append(
            Panel(
                row["figure"],
                row["panel"],
                row["reading"],
                title,
                row["spec"],
                row["hash"],
                verdict,
            )
        )
    return found


def verdicts() -> List[Verdict]:
    """The verdicts on the paper's figures that were published with this version, panel by panel, in
    both readings.

    Our own figures (the lottery) have verdicts too: ``[p.verdict for p in panels("lottery")]``.
    """
    return [
        panel.verdict
        for panel in panels()
        if panel.verdict is not None and panel.figure.startswith("fig")
    ]


def verdict_table() -> str:
    """The same as README's table, in Markdown."""
    return _native.verdict_table()
