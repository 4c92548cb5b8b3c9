"""The console script ``scansion``: the same program as the binary."""

from __future__ import annotations

import sys

from scansion import _core


def main() -> None:
    """Runs the command line and ends the process with its exit code."""
    sys.stdout.flush()
    sys.exit(_core.run(list(sys.argv)))
