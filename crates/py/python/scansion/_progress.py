"""Progress of long calls."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from scansion import _core

Progress = bool | Callable[[str, int, int], Any] | None
"""What ``progress=`` takes."""


@contextmanager
def progress(show: Progress = True) -> Iterator[None]:
    """Shows the progress of all calls of scansion in a ``with`` block, in this thread.

    Parameters
    ----------
    show : bool or callable
        True: a bar of ``tqdm`` if it is installed, else a line on stderr. False or None: nothing. A function is called with the name of the stage,
        the number of items done, and their total (0 if it is not known), at most ten times a second; an exception that it
        raises ends the work.

    Examples
    --------
    >>> import numpy as np, scansion
    >>> stages = []
    >>> with scansion.progress(lambda stage, done, total: stages.append(stage)):
    ...     found = scansion.segment(np.random.default_rng(0).random((2000, 3)) * 10)
    >>> len(stages) > 0
    True
    """
    bar = _Bar() if show is True else None
    own = None if show is None or isinstance(show, bool) else show
    before = _core.follow(own if bar is None else bar.show)
    try:
        yield
    finally:
        _core.follow(before)
        if bar is not None:
            bar.close()


def following(show: Progress) -> AbstractContextManager[None]:
    """What the calls of one method report to: `progress` if it is asked for, else what is followed already."""
    return nullcontext() if show is None else progress(show)


class _Bar:
    """A bar of tqdm, or a line on stderr."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            tqdm = None
        self._tqdm = tqdm
        self._stage = ""
        self._bar: Any = None

    def show(self, stage: str, done: int, total: int) -> None:
        if self._tqdm is None:
            share = f" {min(done / total, 1.0):.0%}" if total else ""
            print(f"\r{stage}{share}".ljust(40), end="", file=sys.stderr, flush=True)
            self._stage = stage
            return
        if self._bar is None or stage != self._stage or self._bar.total != (total or None):
            self.close()
            self._stage = stage
            self._bar = self._tqdm(desc=stage, total=total or None, unit_scale=True, leave=False)
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        elif self._stage and self._tqdm is None:
            print("\r".ljust(41) + "\r", end="", file=sys.stderr, flush=True)
