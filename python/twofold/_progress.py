"""A line on standard error that says how far a computation has come. In a notebook it is redrawn in
place too."""

from __future__ import annotations

import sys
import time
from typing import Callable, Optional, TextIO, Union

Show = Callable[[float, str], object]
"""Called about ten times a second with the share that is done, from 0 to 1, and what is being
computed."""

_WIDTH = 24


def _span(seconds: float) -> str:
    minutes, seconds = divmod(int(seconds + 0.5), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes:02}:{seconds:02}"


class Line:
    """A progress line. Nothing is shown in the first half second: most runs are over by then."""

    def __init__(self, stream: Optional[TextIO] = None, grace: float = 0.5) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._begun = time.monotonic()
        self._grace = grace
        self._shown = 0

    def __call__(self, share: float, label: str) -> None:
        passed = time.monotonic() - self._begun
        if passed < self._grace:
            return
        share = min(max(share, 0.0), 1.0)
        full = int(share * _WIDTH)
        left = _span(passed * (1 - share) / share) if share > 0 else "?"
        bar = "#" * full + "." * (_WIDTH - full)
        self._draw(f"{label}: {100 * share:3.0f} % |{bar}| {_span(passed)} passed, {left} left")

    def _draw(self, text: str) -> None:
        # Blanks instead of a terminal's erase sequence, which notebooks and files show as letters.
        self._stream.write("\r" + text.ljust(self._shown))
        self._stream.flush()
        self._shown = len(text)

    def close(self) -> None:
        """Takes the line away."""
        if self._shown:
            self._draw("")
            self._stream.write("\r")
            self._stream.flush()


class Shown:
    """A display for the length of a ``with`` statement."""

    def __init__(self, progress: Union[bool, Show]) -> None:
        self._line = Line() if progress is True else None
        self._show: Optional[Show] = self._line if progress is True else (progress or None)

    def __enter__(self) -> Optional[Show]:
        return self._show

    def __exit__(self, *_: object) -> None:
        if self._line is not None:
            self._line.close()
