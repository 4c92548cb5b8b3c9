"""How the ground is found, in the form that the core expects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from scansion._arrays import codes, unmasked
from scansion._cloud import PointCloud, as_cloud


def settings(
    cell: float,
    ground: Any,
    noise: Sequence[int] | None,
    slope: float | None = None,
    window: float | None = None,
    wall: float | None = None,
    reach: float = 100.0,
) -> dict[str, Any]:
    """The core's parameters of terrain products."""
    return {
        "cell": cell,
        "ground": "auto" if is_marks(ground) else choice(ground),
        "noise": None if noise is None else code_list(noise, "noise"),
        "filter": filter_settings(slope, window, wall),
        "reach": reach,
    }


def filter_settings(slope: float | None, window: float | None, wall: float | None) -> dict[str, float]:
    """The core's parameters of the ground filter, of those that are given."""
    named = {"slope": slope, "window": window, "wall": wall}
    return {name: value for name, value in named.items() if value is not None}


def choice(ground: Any) -> Any:
    """How the ground is found, in the form that the core expects."""
    if ground is None:
        return "auto"
    if isinstance(ground, str):
        if ground != "filter":
            raise ValueError(f"ground: found {ground!r}, expected 'filter', classes or marks")
        return ground
    return {"classes": code_list(ground, "ground")}


def code_list(classes: Any, name: str) -> list[int]:
    """Class codes as a list; one that stands twice is refused, as codes or marks of all points would be."""
    array = np.atleast_1d(unmasked(classes, name))
    found, counts = np.unique(codes(array, name), return_counts=True)
    if (counts > 1).any():
        marks = name == "ground" and array.dtype != np.bool_
        hint = "; marks of all points are bool, as of .astype(bool)" if marks else ""
        at = int(counts.argmax())
        raise ValueError(f"{name}: found class {found[at]} {counts[at]} times, expected each class once{hint}")
    return [int(code) for code in codes(array, name)]


def is_marks(ground: Any) -> bool:
    """Whether the ground is given by one truth value a point."""
    return ground is not None and not isinstance(ground, str) and np.asarray(ground).dtype == np.bool_


def marked(xyz: Any, ground: Any) -> tuple[PointCloud, Any]:
    """The cloud and how its ground is found; marks become a class."""
    cloud = as_cloud(xyz, columns=["Classification", "Withheld"])
    if not is_marks(ground):
        return cloud, ground
    mask = unmasked(ground, "ground")
    if mask.shape != (len(cloud),):
        raise ValueError(f"ground: expected shape ({len(cloud)},), found {mask.shape}")
    old = cloud["Classification"] if "Classification" in cloud else np.zeros(len(cloud))
    # Cast to a byte, other numbers would become classes such as ground or noise.
    old = np.where((old >= 0) & (old <= 255) & (old == np.floor(old)), old, 1)
    cloud = cloud.copy()
    cloud._put("Classification", np.where(mask, 2, np.where(old == 2, 1, old)).astype(np.uint8))
    return cloud, [2]
