"""Clouds as tables: for people to read, and for other libraries."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scansion._cloud import PointCloud

ATTRS = "scansion"
"""The entry of ``DataFrame.attrs`` with what a cloud has besides its points."""

_FIRST, _LAST = 3, 2
"""Points at the beginning and the end that are shown."""
_MOST = 12
"""Columns that are shown, the coordinates included."""


def rows(cloud: PointCloud) -> dict[str, NDArray[Any]]:
    """X, Y, Z and copies of the columns."""
    core = cloud._core
    found: dict[str, NDArray[Any]] = {name: core.axis(a) for a, name in enumerate("XYZ")}
    for name in cloud.columns:
        values = core.column(name)
        assert values is not None
        found[name] = values
    return found


def about(cloud: PointCloud) -> dict[str, Any]:
    """What a cloud has besides its points, as JSON has it."""
    names = {str(code): name for code, name in cloud.class_names.items()}
    return {"crs": cloud.crs, "metres_per_unit": cloud.metres_per_unit, "scheme": cloud.scheme, "class_names": names}


def take_about(cloud: PointCloud, found: Any) -> None:
    """The inverse of `about`."""
    if not isinstance(found, dict):
        return
    cloud.crs = found.get("crs")
    cloud.metres_per_unit = found.get("metres_per_unit", cloud.metres_per_unit)
    cloud.scheme = found.get("scheme", "own")
    cloud.class_names = {int(code): name for code, name in found.get("class_names", {}).items()}


def as_text(cloud: PointCloud) -> str:
    """The number of points and the first and last of them, in columns."""
    head, table = _shown(cloud)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in table]
    return "\n".join([head, *lines])


def as_html(cloud: PointCloud) -> str:
    """The same for notebooks."""
    head, table = _shown(cloud)
    lines = ["".join(f"<td>{escape(cell)}</td>" for cell in line) for line in table]
    names, *values = [f"<tr>{line}</tr>" for line in lines]
    return f"<div>{escape(head)}<table><thead>{names}</thead><tbody>{''.join(values)}</tbody></table></div>"


def _shown(cloud: PointCloud) -> tuple[str, list[list[str]]]:
    count = len(cloud)
    several = count > _FIRST + _LAST
    points = [*range(_FIRST), *range(count - _LAST, count)] if several else list(range(count))
    columns = rows(cloud.select(np.array(points, dtype=np.int64)))
    left = len(columns) - _MOST
    shown = list(columns)[:_MOST]
    cells = [[name, *(_cell(value) for value in columns[name].tolist())] for name in shown]
    table = [list(line) for line in zip(["", *map(str, points)], *cells, strict=True)]
    if several:
        table.insert(_FIRST + 1, ["..." for _ in table[0]])
    unit = "" if cloud.metres_per_unit in (None, 1.0) else f", {cloud.metres_per_unit:g} m per unit"
    more = "" if left <= 0 else f"; and {left} more columns: {', '.join(list(columns)[_MOST:])}"
    return f"{type(cloud).__name__}: {count:,} points{unit}{more}", table


def _cell(value: float) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
