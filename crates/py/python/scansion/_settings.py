"""Parameters of table classifiers under the core's names, checked."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core

MOST_TREES = 10_000
"""Largest number of trees of a forest, and of rounds of boosting."""


def recipe(given: Any) -> tuple[str, list[str]]:
    """The TOML of a recipe and the settings on top of it, from a path, a text, a name, a mapping of dotted keys, or None."""
    if isinstance(given, Mapping):
        settings = [f"{key}={toml_value(key, value)}" for key, value in _dotted(given) if key != "recipe"]
        return str(given.get("recipe", "")), settings
    if isinstance(given, str) and ("\n" in given or "=" in given):
        return given, []
    if given is None:
        return "", []
    if isinstance(given, str) and given.replace("-", "").isalpha() and not os.path.exists(given):
        return given, []
    return _core.settings_text(os.fspath(given)), []


def dotted_settings(given: Mapping[str, Any], before: str = "") -> list[str]:
    """Settings as the command line's ``--set`` takes them; every key begins with ``before``."""
    return [f"{before}{key}={toml_value(key, value)}" for key, value in _dotted(given)]


def _dotted(given: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of a mapping whose values may be mappings; an empty one is a value."""
    for key, value in given.items():
        if isinstance(value, Mapping) and value:
            yield from _dotted(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def toml_value(key: str, value: Any) -> str:
    """A value as TOML; None is the word "none"."""
    if value is None:
        return '"none"'
    if isinstance(value, np.ndarray):
        return toml_value(key, value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(toml_value(key, item) for item in value)}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{json.dumps(name)} = {toml_value(key, item)}' for name, item in value.items())}}}"
    raise TypeError(
        f"{key}: found {value!r} of type {type(value).__name__}, expected a number, text, True, False, None, a list or a mapping"
    )


def together(settings: Mapping[str, Any] | None, **named: Any) -> dict[str, Any]:
    """Settings (nested, or with dotted keys) and arguments with a name of their own, of which those that are None were not
    given; one that is given in both ways is an error."""
    merged: dict[str, Any] = {}
    for key, value in _dotted(settings or {}):
        _put(merged, key, value)
    for key, value in _dotted(named):
        key = key.replace("__", ".")
        if value is None:
            continue
        if _has(merged, key):
            raise ValueError(f"settings: found {key}, which is an argument too; expected it once")
        _put(merged, key, value)
    return merged


def _put(into: dict[str, Any], key: str, value: Any) -> None:
    *parts, last = key.split(".")
    for part in parts:
        into = into.setdefault(part, {})
        if not isinstance(into, dict):
            raise ValueError(f"settings: found {key} and a value of {part}, expected one of them")
    if isinstance(value, Mapping):
        into.setdefault(last, {})
    else:
        into[last] = value


def _has(within: Any, key: str) -> bool:
    for part in key.split("."):
        if not isinstance(within, dict) or part not in within:
            return False
        within = within[part]
    return True


def seed(random_state: Any) -> int:
    """A seed from scikit-learn's ``random_state``; None means 0, and a float without fraction is a whole number."""
    if random_state is None:
        return 0
    if _is_whole(random_state) and 0 <= random_state < 2**63:
        return int(random_state)
    if isinstance(random_state, np.random.RandomState):
        return int(random_state.randint(0, 2**31 - 1))
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(0, 2**63))
    raise ValueError(
        f"random_state: found {random_state!r}, expected a whole number in 0..2^63, a RandomState or None"
    )


def whole(value: Any, name: str, low: int = 1, high: int | None = None) -> int:
    """An integer from ``low`` to ``high``. As in arrays of codes, a float without fraction is a whole number.

    >>> whole(np.float64(20.0), "k_min")
    20
    """
    wrong = isinstance(value, (bool, np.bool_)) or not _is_whole(value)
    if wrong or value < low or (high is not None and value > high):
        expected = f"a whole number, {low} or more" if high is None else f"a whole number in {low}..{high}"
        raise ValueError(f"{name}: found {value!r}, expected {expected}")
    return int(value)


def _is_whole(value: Any) -> bool:
    if isinstance(value, (float, np.floating)):
        return float(value).is_integer()
    return isinstance(value, (int, np.integer))


def share(value: Any, name: str, limits: tuple[float, float] = (0, 1)) -> float:
    """A number between two limits, both included."""
    low, high = limits
    number = isinstance(value, (int, float, np.integer, np.floating))
    # NaN is in no range.
    if not number or not low <= value <= high or value > sys.float_info.max:
        kind = f"a share in {low}..{high}" if high < np.inf else f"a finite number, {low} or more"
        raise ValueError(f"{name}: found {value!r}, expected {kind}")
    return float(value)


def fraction(value: Any, name: str) -> float:
    """A share above 0, at most 1."""
    if not isinstance(value, (int, float, np.integer, np.floating)) or not 0 < value <= 1:
        raise ValueError(f"{name}: found {value!r}, expected a number above 0, at most 1")
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
    return {"per_class": [_weight_of(label, value.get(label, 1.0)) for label in known]}


_LEAST, _LARGEST = 1e-44, 3e38
"""Limits of class weights, which are those of numbers of 32 bits."""


def _weight_of(label: Any, weight: Any) -> float:
    number = isinstance(weight, (int, float, np.integer, np.floating)) and not isinstance(weight, bool)
    if not number or not _LEAST <= weight <= _LARGEST:
        expected = f"a number above 0 ({_LEAST:g} to {_LARGEST:g})"
        raise ValueError(f"class_weight: found {weight!r} for the label {label!r}, expected {expected}")
    return float(weight)
