"""Files: reading, writing, comparing."""

from __future__ import annotations

import json
import os
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scansion import _core
from scansion._arrays import codes, column, mask, unmasked
from scansion._cloud import PointCloud, as_cloud
from scansion._losses import losses
from scansion._names import asked, axis, meant, read_as, translated, unknown


def _box(bounds: ArrayLike | None) -> Any:
    """A box in the form that the core expects: lowest and highest corner."""
    if bounds is None:
        return None
    box = unmasked(bounds, "bounds", np.float64)
    if box.shape == (2, 2):
        box = np.column_stack([box, [-np.inf, np.inf]])
    if box.shape != (2, 3):
        raise ValueError(f"bounds: found shape {box.shape}, expected (2, 3) or (2, 2): lowest and highest corner")
    return tuple(map(tuple, box.tolist()))


def read(
    path: str | os.PathLike[str],
    columns: list[str] | None = None,
    *,
    bounds: ArrayLike | None = None,
    resolution: float | None = None,
    text_columns: list[str] | None = None,
) -> PointCloud:
    """Reads LAS, LAZ, COPC, PLY, PCD, E57, npz, PTS, PTX or text.

    Parameters
    ----------
    path : path
        The file; the format is detected by content, then by extension.
    columns : list of str, optional
        Columns to keep besides the coordinates; all by default. Fewer columns take less memory. Capitals and underscores do
        not matter, and names of other programs are known too: ``r`` or ``red`` is the column Red. Each value of an array
        ``normal`` in LAS is a column: ``normal0``, ``normal1``, ``normal2``.
    bounds : array_like of shape (2, 3) or (2, 2), optional
        Only points in this box, lowest and highest corner, both included. Of COPC files only the parts in the box are read.
    resolution : float, optional
        Thin to points about this far apart, in the unit of the file, above 0; COPC files only.
    text_columns : list of str, optional
        Names of the columns of a text file, x, y and z (or easting, northing, height) among them; they replace a header
        row. Without names and a header row, four, six and seven columns have the usual meaning, with a warning.

    Returns
    -------
    PointCloud
        In the order and with the types of the file.

    Raises
    ------
    FileNotFoundError, PermissionError, OSError
        The file cannot be read.
    FileFormatError
        The file is malformed (the message gives the position) or its format is not supported.
    ValueError
        The file does not have one of the columns.
    """
    name = os.fspath(path)
    part = (_box(bounds), resolution, text_columns or [])

    def load(names: list[str] | None) -> PointCloud:
        return PointCloud._wrap(_core.read(name, (names, *part)), name)

    if columns is None:
        return load(None)
    names = asked(columns)
    cloud = load(names)
    others = _other_names(cloud, columns, name, text_columns)
    return _picked(load([*names, *others]) if others else cloud, columns)


def _other_names(cloud: PointCloud, columns: list[str], path: str, text_columns: list[str] | None) -> list[str]:
    """Columns that were asked for and are not in the cloud, by their names in the file, where these are other ones; a column
    that the file does not have is an error."""
    absent = [name for name in columns if read_as(name, cloud.columns) not in cloud.columns and axis(name) is None]
    if not absent:
        return []
    about = info(path)
    own: list[str] = text_columns or about["dimensions"]
    if not own and about["points"] == 0:
        return []
    # The header row of a text file has the names of its coordinates too, such as easting.
    known = dict.fromkeys([*own, *(_header(path) if about["format"] == "text" and not text_columns else [])])
    called = {name: _repeated(name, about["dimensions"]) or read_as(name, known) for name in absent}
    nowhere = [name for name in absent if called[name] not in known]
    if nowhere:
        raise unknown(nowhere, [name for name in own if axis(name) is None])
    return [name for name in map(translated, called.values()) if name not in asked(columns)]


def _repeated(name: str, dimensions: list[str]) -> str | None:
    """The name in the file of the second dimension called ``a``, which is ``a_2`` in a cloud."""
    before, _, number = name.rpartition("_")
    return before if number.isdecimal() and name in dimensions and before in dimensions else None


def _header(path: str) -> list[str]:
    """The names in the first line of a text file."""
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        line = next((line for line in file if line.strip() and not line.lstrip().startswith("#")), "")
    words = [word.strip('"') for word in re.split(r"[\s,;]+", line.strip().removeprefix("//"))]
    return [word for word in words if word[:1].isalpha() or word[:1] == "_"]


def _picked(cloud: PointCloud, columns: list[str]) -> PointCloud:
    """The cloud without columns that were not asked for."""
    own = cloud.columns
    kept = {read_as(name, own) for name in columns}
    for name in own:
        if name not in kept:
            del cloud[name]
    return cloud


def blocks(
    path: str | os.PathLike[str],
    size: int = 1_000_000,
    columns: list[str] | None = None,
    *,
    bounds: ArrayLike | None = None,
    resolution: float | None = None,
    text_columns: list[str] | None = None,
) -> Iterator[PointCloud]:
    """Reads a file as clouds of at most ``size`` points, in the order of the file; together they are what `read` returns.

    LAS, LAZ, COPC, PLY, PCD and text need the memory of about one block; E57, npz, PTX and compressed PCD are read as a whole.

    Parameters
    ----------
    path : path
        The file.
    size : int
        Largest number of points of a block, 1 or more.
    columns, bounds, resolution, text_columns
        As in `read`. Numbers in text are float64 in every block.

    Returns
    -------
    iterator of PointCloud
        Empty blocks are skipped.
    """
    if size < 1:
        raise ValueError(f"size: found {size}, expected 1 or more points a block")
    name = os.fspath(path)
    part = (_box(bounds), resolution, text_columns or [])

    def load(names: list[str] | None) -> Iterator[PointCloud]:
        return map(PointCloud._wrap, _core.Blocks(name, size, (names, *part)))

    if columns is None:
        return load(None)
    names = asked(columns)
    found = load(names)

    def picked() -> Iterator[PointCloud]:
        first = next(found, None)
        if first is None:
            return
        others = _other_names(first, columns, name, text_columns)
        for cloud in load([*names, *others]) if others else chain([first], found):
            yield _picked(cloud, columns)

    return picked()


def _steps(scale: float | Sequence[float] | None) -> Any:
    """One scale per axis."""
    if scale is None:
        return None
    steps = unmasked(scale, "scale", np.float64)
    if steps.shape not in ((), (3,)):
        raise ValueError(f"scale: found shape {steps.shape}, expected a number or three")
    return tuple(np.broadcast_to(steps, 3).tolist())


def write(
    path: str | os.PathLike[str], cloud: Any, *, scale: float | Sequence[float] | None = None
) -> None:
    """Writes points as LAS, LAZ, PLY, PCD, npz or text, by the extension; the file is either complete or absent.

    LAS and LAZ keep the reference system, or, if there is none, the unit, as a local system; npz keeps both, the others none.
    The file is a new one, dated today: `rewrite` keeps all of a LAS file but its classes and dimensions.

    Parameters
    ----------
    path : path
        ``.las``, ``.laz``, ``.ply``, ``.pcd``, ``.npz``, ``.txt``, ``.xyz``, ``.csv`` or ``.labels`` (class codes alone).
    cloud : PointCloud, laspy.LasData, structured array or array_like of shape (n, 3)
        What to write.
    scale : float or three of them, optional
        LAS scale: step of the integers in which LAS and LAZ store coordinates. None uses the cloud's own if it came from LAS,
        else 0.001 (1e-7 for degrees), or a scale that moves no point by more than a thousandth of the point spacing.

    Raises
    ------
    ValueError
        No scale represents the extent in 32 bits without such a loss; give ``scale`` to accept it.

    Warns
    -----
    UserWarning
        The file does not keep the reference system, the unit, or a record of the LAS file from which the cloud came.
    """
    name = os.fspath(path)
    points = as_cloud(cloud)
    lost = losses(points, name)
    _core.write(name, points._core, _steps(scale))
    if lost:
        advice = "; rewrite keeps the records of a LAS file" if "record" in lost[-1] else ""
        warnings.warn(f"{name}: not kept: {', '.join(lost)}{advice}", stacklevel=2)


def rewrite(
    input: str | os.PathLike[str],
    output: str | os.PathLike[str],
    classification: ArrayLike | None = None,
    dimensions: Mapping[str, ArrayLike] | None = None,
    *,
    keep: ArrayLike | None = None,
    scale: float | Sequence[float] | None = None,
) -> list[str]:
    """Copies a file, or some of its points, with other classes or more dimensions; all other bytes are kept.

    Parameters
    ----------
    input, output : path
        May be the same file.
    classification : array_like of shape (n,), optional
        Class codes 0..255 in the file's order.
    dimensions : mapping of str to array_like of shape (n,), optional
        Dimensions to add or replace (Extra Bytes in LAS). Capitals and underscores in the names of the file's dimensions
        do not matter, and laspy's names are known too; coordinates are not replaced.
    keep : array_like of shape (n,), bool, optional
        Whether each point is written; all by default. Counts and bounds in a LAS header become those of these points.
    scale : float or three of them, optional
        As in `write`; not from LAS to LAS, which keeps its scale.

    Returns
    -------
    list of str
        What else had to change, e.g. that LAS was promoted to 1.4 for classes above 31.
    """
    labels = None if classification is None else codes(classification, "classification")
    own = info(input)["dimensions"] if dimensions else []
    extra = [(_dimension(name, own), column(values, name)) for name, values in (dimensions or {}).items()]
    kept = None if keep is None else mask(keep, "keep")
    return _core.rewrite(os.fspath(input), os.fspath(output), (labels, extra), kept, _steps(scale))


def _dimension(name: str, own: list[str]) -> str:
    """The dimension that a name means in a file with these."""
    if axis(name) is not None:
        raise ValueError(f"dimensions: found {name}, the name of a coordinate, expected other names")
    return meant(name, own)


def info(path: str | os.PathLike[str], *, stats: bool = False) -> dict[str, Any]:
    """Information from a file's header: format, version, point count, bounds, reference system, dimensions, warnings.

    Parameters
    ----------
    path : path
        The file; the points of LAS and LAZ are not read unless ``stats`` is set.
    stats : bool
        Read the points too: the key ``stats`` has ``points_per_square_metre``, ``not_finite``, ``duplicates``,
        ``outside_bounds``, ``nan_values`` and ``classes`` (code, points).

    Returns
    -------
    dict
        Text, numbers, lists and dicts only, as in JSON.
    """
    found: dict[str, Any] = json.loads(_core.inspect(os.fspath(path)))
    if stats:
        counts, density, bounds = json.loads(_core.statistics(os.fspath(path)))
        found["warnings"] += counts.pop("warnings")
        found["bounds"] = found["bounds"] or bounds
        found["stats"] = {"points_per_square_metre": density, **counts}
    return found


def diff(a: str | os.PathLike[str], b: str | os.PathLike[str]) -> dict[str, Any]:
    """The differences between two files, field by field, and point by point in their order.

    LAS and LAZ are compared with header and records, block by block; other formats by their columns.

    Parameters
    ----------
    a, b : path
        The files; their formats may differ. The compression (LAS or LAZ) does not count as a difference.

    Returns
    -------
    dict
        ``same`` (bool), ``summary`` (one sentence), ``points``, ``compared``, and the differences, empty if there are none:
        ``header``, ``records``, ``types`` (lists of ``name``, ``a``, ``b``), ``fields`` (``name``, ``differing``, ``first``,
        ``largest``: None if no two numbers differ, ``one_sided``: points where only one of the two is a number), ``only_in`` (two
        lists of names), ``classes`` (``from``, ``to``, ``points``).
    """
    same, summary, found = json.loads(_core.diff(os.fspath(a), os.fspath(b)))
    return {"same": same, "summary": summary, **found}


def convert(
    input: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    point_format: int | None = None,
    bounds: ArrayLike | None = None,
    resolution: float | None = None,
    scale: float | Sequence[float] | None = None,
) -> list[str]:
    """Copies a file into the format of the output's extension.

    Parameters
    ----------
    input, output : path
        May be the same file.
    point_format : int, optional
        Point format of a LAS or LAZ output made from LAS or LAZ, 0 to 10; it must have all fields of the input's.
    bounds, resolution
        Only this part of the input, as in `read`.
    scale : float or three of them, optional
        As in `write`; not from LAS to LAS, which keeps its scale.

    Returns
    -------
    list of str
        What the target could not store.
    """
    part = (_box(bounds), resolution)
    return _core.convert(os.fspath(input), os.fspath(output), point_format, part, _steps(scale))


def merge(
    inputs: Sequence[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    scale: float | Sequence[float] | None = None,
) -> list[str]:
    """Merges files in the given order; coordinates of LAS and LAZ are converted exactly to a common grid.

    Parameters
    ----------
    inputs : sequence of path
        Files in one reference system.
    output : path
        May be one of the inputs.
    scale : float or three of them, optional
        As in `write`; not from LAS to LAS, which keeps its scale.

    Returns
    -------
    list of str
        What else had to change.
    """
    return _core.merge([os.fspath(path) for path in inputs], os.fspath(output), _steps(scale))


def salvage(
    input: str | os.PathLike[str], output: str | os.PathLike[str] | None = None
) -> dict[str, Any]:
    """Determines what can be read of a damaged LAS or LAZ file, and writes it as an intact file if an output is given.

    Parameters
    ----------
    input : path
        A file that is truncated, has wrong counts, a lost chunk table or damaged chunks.
    output : path, optional
        File for the intact part.

    Returns
    -------
    dict
        ``declared`` and ``read`` (numbers of points), ``lost``, ``notes`` (the defects; empty for an intact file).
    """
    found: dict[str, Any] = json.loads(_core.salvage(os.fspath(input), None if output is None else os.fspath(output)))
    return {**found, "lost": max(0, found["declared"] - found["read"])}
