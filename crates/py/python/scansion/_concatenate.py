"""Several clouds as one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import choice
from scansion._cloud import PointCloud, as_cloud


def concatenate(clouds: Iterable[Any], *, columns: str = "same") -> PointCloud:
    """The points of several clouds, one after the other.

    Coordinates of LAS files keep their integers if all have one scale and offset. Of several names of a class code
    that of the first cloud is kept.

    Parameters
    ----------
    clouds : iterable of clouds
        Each a PointCloud, path, laspy.LasData, structured array or array of shape (n, 3), in one reference system.
    columns : {"same", "common", "all"}
        All must have the same columns; keep those that all have; or keep all, with 0 (NaN in columns of floats) where a
        cloud has none.

    Raises
    ------
    ValueError
        The columns or the reference systems differ.

    Examples
    --------
    >>> import scansion
    >>> a = scansion.PointCloud([[0, 0, 0]], Classification=[2])
    >>> b = scansion.PointCloud([[1, 0, 0], [2, 0, 0]], Classification=[6, 6])
    >>> scansion.concatenate([a, b])["Classification"].tolist()
    [2, 6, 6]
    """
    choice(columns, "columns", ("same", "common", "all"))
    parts = [as_cloud(cloud) for cloud in clouds]
    if not parts:
        raise ValueError("clouds: found none, expected one or more")
    first = parts[0]
    for at, part in enumerate(parts):
        if _system(part) != _system(first) or part.metres_per_unit != first.metres_per_unit:
            raise ValueError(
                f"reference systems: found {part.crs or 'none'} ({part.metres_per_unit or 'no'} m per unit) in cloud {at}, "
                f"expected that of cloud 0: {first.crs or 'none'} ({first.metres_per_unit or 'no'} m per unit)"
            )
    whole = PointCloud._wrap(_places(parts))
    whole.crs = first.crs
    if first.metres_per_unit is not None:
        whole.metres_per_unit = first.metres_per_unit
    for name in _names(parts, columns):
        whole._put(name, _joined(parts, name))
    whole.scheme = first.scheme if all(part.scheme == first.scheme for part in parts) else "own"
    whole.class_names = {code: name for part in reversed(parts) for code, name in part.class_names.items()}
    return whole


def _system(cloud: PointCloud) -> str | None:
    """The reference system; None for one that tells only the unit, as LAS files of a cloud without a system have."""
    empty = _core.Cloud.from_xyz(np.empty((0, 3)))
    empty.metres_per_unit = cloud.metres_per_unit
    return None if cloud.crs == empty.wkt() else cloud.crs


def _places(parts: list[PointCloud]) -> _core.Cloud:
    ticks = [part._core.ticks() for part in parts]
    if ticks[0] is not None and all(t is not None and t[1:] == ticks[0][1:] for t in ticks):
        _, scale, offset = ticks[0]
        joined = np.concatenate([t[0] for t in ticks if t is not None])
        return _core.Cloud.from_ticks(joined, tuple(scale), tuple(offset))
    return _core.Cloud.from_xyz(np.concatenate([part.xyz for part in parts]))


def _names(parts: list[PointCloud], columns: str) -> list[str]:
    every = list(dict.fromkeys(name for part in parts for name in part.columns))
    common = [name for name in every if all(name in part.columns for part in parts)]
    if columns == "same" and len(common) < len(every):
        missing = ", ".join(
            f"{name} (not in cloud {next(at for at, part in enumerate(parts) if name not in part.columns)})"
            for name in every
            if name not in common
        )
        raise ValueError(f'columns: found {missing}, expected the same in all clouds, or columns="common" or "all"')
    return every if columns == "all" else common


def _joined(parts: list[PointCloud], name: str) -> NDArray[Any]:
    kind = np.result_type(*(part[name].dtype for part in parts if name in part.columns))
    absent = np.nan if kind.kind == "f" else 0
    blank = (np.full(len(part), absent, kind) for part in parts)
    return np.concatenate(
        [part[name].astype(kind) if name in part.columns else empty for part, empty in zip(parts, blank, strict=True)]
    )
