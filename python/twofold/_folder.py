"""A paper as a folder of systems, figures and claims: what ``twofold paper`` makes and checks
(docs/papers.md)."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Tuple, Union

import numpy as np

from . import _native
from ._paper import Verdict
from ._progress import Shown
from ._runs import Progress, Table

__all__ = ["Claim", "Figure", "Paper", "Answer"]


@dataclass(frozen=True)
class Figure:
    """A figure of a paper's folder."""

    id: str
    """The name of its file, "fig3"."""
    title: str
    """Its heading."""
    shows: str
    """What in the paper it shows."""


@dataclass(frozen=True)
class Claim:
    """What a paper says, held against what was computed."""

    id: str
    """Its name in claims.toml."""
    place: str
    """Where the paper says it."""
    says: str
    """What it says, in the folder's words."""
    check: str
    """The kind of check."""
    decided: str
    """The day on which the rule was fixed."""
    agrees: Optional[bool]
    """Whether it holds; None if it cannot be scored."""
    found: str
    """What was found, or why it cannot be scored."""
    odds: Optional[Tuple[int, int]]
    """Repeated runs in which it holds, and all of them; None if nothing is repeated."""
    quote: str
    """The paper's own words, a few of them."""
    note: str
    """Remarks beside the outcome."""
    rule_after_data: bool
    """Whether the rule was written or changed when its data were already known."""
    words_after_data: bool
    """The same of what it says."""


class Answer:
    """The answer to a panel or measure: ``answer.facts``, ``answer.tables["path"]["x"]``."""

    def __init__(self, raw: "_native._PlainAnswer") -> None:
        self.hash: str = raw["hash"]
        """Digest of the numbers, the same on any machine."""
        self.facts: Dict[str, Any] = json.loads(raw["facts"])
        """What was found beside tables: a period, multipliers, exponents."""
        self.tables: Dict[str, Table] = {
            name: Table(columns) for name, columns in raw["tables"].items()
        }
        """Tables by name, their columns NumPy arrays."""

    def __repr__(self) -> str:
        return f"<twofold.Answer: facts {', '.join(self.facts)}; tables {', '.join(self.tables)}>"


class Paper:
    """A paper's folder.

    Reading it checks every file. Answers are kept in ``out/.store`` of the folder, where ``twofold
    paper`` finds them, unless ``keep`` is false.

    :raises DefinitionError: if a file is wrong, with its place and a remedy.
    """

    def __init__(self, folder: Union[str, "os.PathLike[str]"], keep: bool = True) -> None:
        self._folder = os.fspath(folder)
        self._keep = keep
        said = json.loads(_native.paper(self._folder))
        self.title: str = said["title"]
        self.authors: List[str] = said["authors"]
        self.year: int = said["year"]
        self.journal: str = said["journal"]
        self.doi: str = said["doi"]
        self.arxiv: str = said["arxiv"]
        self.summary: str = said["summary"]
        self.open: List[str] = said["open"]
        """What the paper leaves open."""
        self.figures: List[Figure] = [Figure(**figure) for figure in said["figures"]]
        self.names: List[str] = said["sources"]
        """Panels ("fig3/a", in a reading "fig3/a@NAME") and measures, for :meth:`answer`."""
        self.points: Dict[str, Table] = {
            panel: Table({axis: np.array(values) for axis, values in columns.items()})
            for panel, columns in said["points"].items()
        }
        """Numbers of the paper (``data/*.csv``) that panels are drawn with, by panel: x and y."""
        self._claims: Dict[str, Dict[str, Any]] = {claim["id"]: claim for claim in said["claims"]}

    def answer(self, name: str, threads: int = 0, progress: Progress = False) -> Answer:
        """What a panel or measure asks, computed or taken from the folder's store; ``threads`` = 0
        is one per core and changes no byte.

        :raises SpecError: if there is none of this name.
        """
        with Shown(progress) as show:
            return Answer(_native.paper_answer(self._folder, name, threads, self._keep, show))

    def claims(self, threads: int = 0, progress: Progress = False) -> List[Claim]:
        """Every claim of claims.toml with its outcome, in the file's order; ``threads`` = 0 is one
        per core and changes no byte.

        What panels say of themselves (``says``) is in :meth:`verdicts`.
        """
        with Shown(progress) as show:
            verdicts = json.loads(_native.paper_claims(self._folder, threads, self._keep, show))
        unscored = {"odds": None, "rule_after_data": False, "words_after_data": False}
        found = []
        for verdict in verdicts:
            claim = {**self._claims[verdict["id"]], **unscored, **verdict}
            claim["odds"] = claim["odds"] and tuple(claim["odds"])
            found.append(Claim(**claim))
        return found

    def verdicts(self, threads: int = 0, progress: Progress = False) -> List[Verdict]:
        """What panels say of themselves (``says``), in the figures' order, with its outcome."""
        with Shown(progress) as show:
            found = json.loads(_native.paper_verdicts(self._folder, threads, self._keep, show))
        return [Verdict(**verdict) for verdict in found]

    def __repr__(self) -> str:
        return (f"<twofold.Paper: {', '.join(self.authors)} ({self.year}), {len(self.figures)} "
                f"figures, {len(self._claims)} claims>")
