"""Parameters of table classifiers under the core's names, checked."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core


def recipe(given: Any) -> tuple[str, list[str]]:
    """The TOML of a recipe and the settings on top of it, from a path, a text, a mapping of dotted keys, or None."""
    if isinstance(given, Mapping):
        settings = [f"{key}={json.dumps(value)}" for key, value in given.items() if key != "recipe"]
        return str(given.get("recipe", "")), settings
    if isinstance(given, str) and ("\n" in given or "=" in given):
        return given, []
    if given is None:
        return "", []
    return _core.settings_text(os.fspath(given)), []


def seed(random_state: Any) -> int:
    """A seed from scikit-learn's ``random_state``; None means 0."""
    if random_state is None:
        return 0
    if isinstance(random_state, (int, np.integer)) and 0 <= random_state < 2**63:
        return int(random_state)
    if isinstance(random_state, np.random.RandomState):
        return int(random_state.randint(0, 2**31 - 1))
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(0, 2**63))
    raise ValueError(
        f"random_state: found {random_state!r}, expected a whole number in 0..2^63, a RandomState or None"
    )


def whole(value: Any, name: str, low: int = 1) -> int:
    """An integer, at least ``low``."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < low:
        raise ValueError(f"{name}: found {value!r}, expected a whole number, {low} or more")
    return int(value)


def share(value: Any, name: str, limits: tuple[float, float] = (0, 1)) -> float:
    """A number between two limits, both included."""
    low, high = limits
    if not isinstance(value, (int, float, np.integer, np.floating)) or not low <= value <= high:
        kind = f"a share in {low}..{high}" if high < np.inf else f"a finite number, {low} or more"
        raise ValueError(f"{name}: found {value!r}, expected {kind}")
    return float(value)


def class_weight(value: Any, classes: NDArray[Any]) -> Any:
    """None, "balanced" or a dict of label to weight."""
    if value is None:
        return "none"
    if isinstance(value, str) and value == "balanced":
        return "balanced"
    if not isinstance(value, Mapping):
        raise ValueError(
            f"class_weight: found {value!r}, expected None, 'balanced' or a dict of label to weight"
        )
    known = classes.tolist()
    unknown = [label for label in value if label not in known]
    if unknown:
        raise ValueError(f"class_weight: the labels {unknown} are not in y")
    return {"per_class": [float(value.get(label, 1.0)) for label in known]}
