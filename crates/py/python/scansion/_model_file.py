"""Notes of Python in model files: that the labels in training were text, so that predictions are text again, and how
labels are read (``class_map`` and ``unlabelled``), so that scores are the same after loading.

A model file is safetensors; the notes are entries of its metadata beside the core's own, which every version of the core
ignores. The core's entry has the SHA-256 of the file, computed with zeros in its place.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterable
from typing import Any

import numpy as np

_START = b'{"__metadata__":{'
_LENGTH = 8
"""Bytes before the header, which tell its length; the length of the header is a multiple of this number too."""
_TEXT, _LABELS = "labels", "label_settings"
"""The entries: ``"text"`` if the labels were text, and the settings of labels that are not the default ones, as JSON."""


class Notes:
    """What Python keeps in a model file besides the model."""

    def __init__(self, text: bool = False, class_map: str = "", unlabelled: Iterable[Any] | None = None) -> None:
        self.text = text
        self.class_map = class_map
        self.unlabelled = None if unlabelled is None else [_plain(label) for label in unlabelled]

    def entries(self) -> dict[str, str]:
        """The entries of the metadata; none if everything is as by default."""
        found = {_TEXT: "text"} if self.text else {}
        if self.class_map or self.unlabelled is not None:
            found[_LABELS] = json.dumps({"class_map": self.class_map, "unlabelled": self.unlabelled})
        return found


def _plain(label: Any) -> Any:
    """A label as JSON can have it."""
    label = label.item() if isinstance(label, np.generic) else label
    return label.decode() if isinstance(label, bytes) else label


def notes(path: str | os.PathLike[str]) -> Notes:
    """The notes in a model file that the core has read; a pipe, which can be read only once, has none."""
    if not os.path.isfile(path):
        return Notes()
    with open(path, "rb") as file:
        length = int.from_bytes(file.read(_LENGTH), "little")
        metadata = json.loads(file.read(length))["__metadata__"]
    settings = json.loads(metadata.get(_LABELS, "{}"))
    return Notes(metadata.get(_TEXT) == "text", settings.get("class_map", ""), settings.get("unlabelled"))


def add_notes(path: str | os.PathLike[str], given: Notes) -> None:
    """Adds the notes to a model file; the file is either as before or complete."""
    place = os.path.realpath(path)
    entries = given.entries()
    if not entries or not os.path.isfile(place):
        return
    with open(place, "rb") as file:
        noted = _noted(file.read(), entries)
    with tempfile.TemporaryDirectory(dir=os.path.dirname(place)) as folder:
        partial = os.path.join(folder, "model")
        with open(partial, "wb") as file:
            file.write(noted)
        shutil.copymode(place, partial)
        os.replace(partial, place)


def _noted(model: bytes, entries: dict[str, str]) -> bytes:
    header = model[_LENGTH:]
    sum_of = re.compile(rb'sha256\\":\\"([0-9a-f]{64})').search(header)
    if not header.startswith(_START) or sum_of is None:
        raise ValueError("model: found another header than this version writes; how labels are read is not in the file")
    added = json.dumps(entries, separators=(",", ":"))[1:-1].encode() + b","
    added += b" " * (-len(added) % _LENGTH)
    length = int.from_bytes(model[:_LENGTH], "little") + len(added)
    before, after = header[: sum_of.start(1)], header[sum_of.end(1) :]
    first = length.to_bytes(_LENGTH, "little") + _START + added + before[len(_START) :]
    checksum = hashlib.sha256(first + b"0" * 64 + after).hexdigest().encode()
    return first + checksum + after
