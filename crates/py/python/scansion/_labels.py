"""Labels in the forms that users have: codes 0..255 (negative: unlabelled), or text (None: unlabelled)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import codes, column, unmasked

MOST = 256
"""Number of possible codes, and so of classes."""


def is_text(values: Any) -> bool:
    """Whether labels are text: an array of strings, or of objects with a string among them."""
    array = np.asarray(values)
    if array.dtype.kind != "O":
        return array.dtype.kind in "UST"
    return any(isinstance(value, (str, bytes)) for value in array.ravel())


def check_kind(values: Any, classes: NDArray[Any], name: str) -> None:
    """Refuses text where the classes are numbers, and numbers where they are text."""
    kinds = ["text" if is_text(array) else "numbers" for array in (values, classes)]
    if kinds[0] != kinds[1]:
        raise ValueError(f"{name}: found {kinds[0]}, expected {kinds[1]}, which is what the model learned")


def numbers(values: Any, name: str) -> NDArray[Any]:
    """Labels that are numbers, as an array; NaN for None.

    >>> numbers([2, None], "labels")
    array([ 2., nan])
    """
    array = unmasked(values, name)
    if array.dtype.kind != "O" or array.ndim != 1:
        return array
    known = [np.nan if value is None else value for value in array]
    return array if any(np.ndim(value) for value in known) else np.array(known)


def texts(values: Any, name: str, length: int | None = None) -> NDArray[np.object_]:
    """Labels as text, one a point; None for missing ones (None or NaN)."""
    array = unmasked(values, name)
    if array.ndim != 1 or (length is not None and len(array) != length):
        expected = "(n,)" if length is None else f"({length},)"
        raise ValueError(f"{name}: expected shape {expected}, found {array.shape}")
    found = np.empty(len(array), dtype=object)
    for i, value in enumerate(array.tolist()):
        if isinstance(value, str):
            found[i] = value
        elif isinstance(value, bytes):
            found[i] = value.decode()
        elif not (value is None or (isinstance(value, float) and np.isnan(value))):
            raise TypeError(f"{name}: expected text or None, found {value!r} at index {i}")
    return found


def no_classes(unlabelled: Iterable[Any]) -> set[str | None]:
    """Labels that are no class although they are text: those that mean "unlabelled", and None."""
    if isinstance(unlabelled, (str, bytes)):
        raise TypeError(f"unlabelled: found {unlabelled!r}, expected a list of labels")
    listed = list(unlabelled)
    array = np.empty(len(listed), dtype=object)
    array[:] = listed
    return {None, *texts(array, "unlabelled").tolist()}


def classes_of(labels: Iterable[NDArray[np.object_]], unlabelled: Iterable[Any]) -> list[str]:
    """The texts that are classes, in alphabetical order."""
    missing = no_classes(unlabelled)
    found = sorted({text for array in labels for text in set(array.tolist()) if text not in missing})
    if len(found) > MOST:
        raise ValueError(f"labels: found {len(found)} different texts, expected at most {MOST} classes")
    return found


def encoded(labels: NDArray[np.object_], classes: list[str]) -> NDArray[np.int16]:
    """The position of each label among the classes, -1 if it is not one of them."""
    place = {text: i for i, text in enumerate(classes)}
    return np.array([place.get(text, -1) for text in labels.tolist()], dtype=np.int16)


def signed(
    values: Any, name: str, length: int | None = None, unlabelled: Iterable[int] = (), changes: str | None = None
) -> NDArray[np.int16]:
    """Codes 0..255, changed by a map like ``3-4=5``; -1 where they are negative, NaN or, after the mapping, ``unlabelled``.

    Codes above 255 need an entry in the map. None is the map of a function that takes none.
    """
    array = column(numbers(values, name), name, length)
    known = array >= 0
    large = array >= MOST
    beyond = _beyond(array[large], name, changes)
    changes = changes or ""
    array = np.where(large, 0, array)
    table = np.frombuffer(_core.mapped_codes(changes), dtype=np.uint8).astype(np.int16)
    skipped = listed(unlabelled)
    for code in skipped:
        table[table == code] = -1
    found = np.full(len(array), -1, dtype=np.int16)
    found[known] = table[codes(np.where(known, array, 0), name)[known]]
    missing = np.frombuffer(skipped, dtype=np.uint8)
    found[large] = np.where(np.isin(beyond, missing), -1, beyond)
    return found


def _beyond(values: NDArray[Any], name: str, changes: str | None) -> NDArray[np.int16]:
    """The codes to which a map changes these, which are above 255."""
    distinct, places = np.unique(values, return_inverse=True)
    found = np.empty(len(distinct), dtype=np.int16)
    for i, value in enumerate(distinct.tolist()):
        code = _core.mapped_code(changes or "", int(value)) if value == value // 1 and value < 1 << 32 else None
        if code is None:
            raise ValueError(f"{name}: expected whole numbers in 0..255, found {value}{_advice(value, name, changes)}")
        found[i] = code
    return found[places.reshape(-1)]


def _advice(value: float, name: str, changes: str | None) -> str:
    """How a code above 255 is mapped, if there is a map for it."""
    if changes is None or value != value // 1 or value >= 1 << 32:
        return ""
    option = {"truth": "map_truth", "predicted": "map_predicted"}.get(name, "class_map")
    return f'; {option} changes larger ones, as in {option}="{int(value)}=5"'


def listed(unlabelled: Iterable[int]) -> bytes:
    """Codes as bytes, the form in which the core takes short lists; negative ones are left out."""
    array = np.asarray(list(unlabelled))
    if array.size == 0:
        return b""
    return codes(array[~(column(array, "unlabelled") < 0)], "unlabelled").tobytes()
