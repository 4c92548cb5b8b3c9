"""A note in model files: that the labels in training were text, so that predictions are text again.

A model file is safetensors; the note is an entry of its metadata beside the core's own, which every version of the core
ignores. The core's entry has the SHA-256 of the file, computed with zeros in its place.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile

_START = b'{"__metadata__":{'
_NOTE = b'"labels":"text",'
"""As long as the alignment of the header asks: a multiple of 8 bytes."""
_LENGTH = 8
"""Bytes before the header, which tell its length."""


def has_text(path: str | os.PathLike[str]) -> bool:
    """Whether the file has the note; a pipe, which can be read only once, has none."""
    if not os.path.isfile(path):
        return False
    with open(path, "rb") as file:
        file.seek(_LENGTH)
        return file.read(len(_START + _NOTE)) == _START + _NOTE


def mark_text(path: str | os.PathLike[str]) -> None:
    """Adds the note to a model file; the file is either as before or complete."""
    place = os.path.realpath(path)
    if not os.path.isfile(place):
        return
    with open(place, "rb") as file:
        marked = _marked(file.read())
    with tempfile.TemporaryDirectory(dir=os.path.dirname(place)) as folder:
        partial = os.path.join(folder, "model")
        with open(partial, "wb") as file:
            file.write(marked)
        shutil.copymode(place, partial)
        os.replace(partial, place)


def _marked(model: bytes) -> bytes:
    header = model[_LENGTH:]
    sum_of = re.compile(rb'sha256\\":\\"([0-9a-f]{64})').search(header)
    if not header.startswith(_START) or sum_of is None:
        raise ValueError("model: found another header than this version writes; the labels will be loaded as codes")
    length = int.from_bytes(model[:_LENGTH], "little") + len(_NOTE)
    before, after = header[: sum_of.start(1)], header[sum_of.end(1) :]
    first = length.to_bytes(_LENGTH, "little") + _START + _NOTE + before[len(_START) :]
    checksum = hashlib.sha256(first + b"0" * 64 + after).hexdigest().encode()
    return first + checksum + after
