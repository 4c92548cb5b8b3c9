"""Clouds: points and their columns."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scansion import _core
from scansion._arrays import as_array, column, coordinates, filled, mask, native, unmasked
from scansion._cloud_table import ATTRS, about, as_html, as_text, rows, take_about
from scansion._laspy import from_laspy, to_laspy
from scansion._names import axis, meant, missing, our_names


class PointCloud:
    """Points with named columns, one value a point.

    Coordinates of LAS files are kept as the integers in the file, so that writing gives the same bytes. ``cloud["name"]`` is
    the column itself: what is written into it is in the cloud. ``cloud[mask]``, ``cloud[indices]`` and ``cloud[a:b]`` are
    new clouds of some of the points. As an array, a cloud is its coordinates. Capitals and underscores in names do not matter,
    laspy's names are known too, and ``cloud["X"]`` is ``cloud.x``.

    Parameters
    ----------
    xyz : array_like of shape (n, 3)
        Coordinates in the unit of the reference system.
    crs : str, optional
        Coordinate reference system, as WKT, ``EPSG:n``, or ``EPSG:n+m`` with a vertical system m; it defines the unit.
    metres_per_unit : float, optional
        Metres per unit of the coordinates (0.3048 for feet).
    **columns : array_like of shape (n,)
        One column each, e.g. ``Classification=...``. Names become PDAL's if it has one.

    Examples
    --------
    >>> import numpy as np
    >>> import scansion
    >>> cloud = scansion.PointCloud([[0, 0, 1], [1, 0, 7]], Classification=np.array([2, 6], dtype=np.uint8))
    >>> len(cloud), cloud.columns
    (2, ['Classification'])
    >>> cloud["Classification"][cloud.z > 5] = 5
    >>> cloud["Classification"]
    array([2, 5], dtype=uint8)
    >>> cloud[cloud.z > 5].xyz
    array([[1., 0., 7.]])
    >>> cloud
    PointCloud: 2 points
           X      Y      Z  Classification
    0  0.000  0.000  1.000               2
    1  1.000  0.000  7.000               5
    """

    __slots__ = ("_header", "_native", "_path", "_views")

    def __init__(
        self,
        xyz: ArrayLike,
        *,
        crs: str | None = None,
        metres_per_unit: float | None = None,
        **columns: ArrayLike,
    ) -> None:
        self._take(_core.Cloud.from_xyz(coordinates(xyz)), None)
        for name in columns:
            if axis(name) is not None:
                raise ValueError(f"{name}: found the name of a coordinate, expected that of a column")
        ours = our_names(columns)
        self._fill(crs, metres_per_unit, {ours[name]: values for name, values in columns.items()})

    def _take(self, core: _core.Cloud, path: str | None) -> None:
        self._native, self._path = core, path
        self._header: dict[str, Any] | None = None
        self._views: dict[str, NDArray[Any]] = {}

    def _fill(self, crs: str | None, metres_per_unit: float | None, columns: Mapping[str, ArrayLike]) -> None:
        self._native.crs = crs
        if metres_per_unit is not None:
            self._native.metres_per_unit = metres_per_unit
        for name, values in columns.items():
            self._put(name, values)

    @classmethod
    def _wrap(cls, core: _core.Cloud, path: str | None = None) -> PointCloud:
        cloud = cls.__new__(cls)
        cloud._take(core, path)
        return cloud

    @property
    def _core(self) -> _core.Cloud:
        """The native cloud, with what was written into the arrays of its columns."""
        for name, values in self._views.items():
            self._native.update_column(name, values)
        return self._native

    @property
    def xyz(self) -> NDArray[np.float64]:
        """Coordinates, an ``(n, 3)`` array that cannot be written: ``cloud.xyz.copy()`` can, and `PointCloud` takes it."""
        return _read_only(self._native.xyz())

    @property
    def x(self) -> NDArray[np.float64]:
        """The first coordinate, read-only."""
        return _read_only(self._native.axis(0))

    @property
    def y(self) -> NDArray[np.float64]:
        """The second coordinate, read-only."""
        return _read_only(self._native.axis(1))

    @property
    def z(self) -> NDArray[np.float64]:
        """The height, read-only."""
        return _read_only(self._native.axis(2))

    @property
    def shape(self) -> tuple[int, int]:
        """Of the coordinates: (number of points, 3)."""
        return len(self), 3

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False:
            raise ValueError("copy: found False; the coordinates of a cloud are always copied")
        return as_array(self._native.xyz(), dtype, False)

    @property
    def columns(self) -> list[str]:
        """Names of the columns, in the order of the file."""
        return self._native.columns()

    @property
    def header(self) -> dict[str, Any]:
        """Header information of the cloud's file, as from `scansion.info` at the first access; empty for a cloud that was
        made in memory."""
        if self._header is None:
            self._header = {} if self._path is None else json.loads(_core.inspect(self._path))
        return self._header

    @property
    def crs(self) -> str | None:
        """Coordinate reference system as the file states it: WKT, ``EPSG:n``, or ``EPSG:n+m`` with a vertical system m. If
        another is set, a unit that is that of the former one becomes that of the new one."""
        return self._native.crs

    @crs.setter
    def crs(self, crs: str | None) -> None:
        self._native.crs = crs

    @property
    def metres_per_unit(self) -> float | None:
        """Metres per unit of the coordinates, if the file states it."""
        return self._native.metres_per_unit

    @metres_per_unit.setter
    def metres_per_unit(self, metres: float | None) -> None:
        self._native.metres_per_unit = metres

    @property
    def scheme(self) -> str:
        """The class list of codes, in the column Classification or beside the cloud: ``"asprs"`` (LAS: 0 and 1 are unlabelled),
        ``"semantic3d"``, ``"toronto-3d"``, ``"paris-lille-3d"`` (0 is), ``"semantickitti"`` (0 and 1 are), ``"s3dis"`` or
        ``"own"`` (every code is a class). Set by readers; may be changed."""
        return self._native.scheme

    @scheme.setter
    def scheme(self, scheme: str) -> None:
        self._native.scheme = scheme

    @property
    def class_names(self) -> dict[int, str]:
        """Names of class codes that come before those of the class list: of LAS those in its lookup record. A copy; assign
        a dict to change them, as in ``cloud.class_names = {15: "pole"}``."""
        return self._native.class_names

    @class_names.setter
    def class_names(self, names: Mapping[int, str]) -> None:
        self._native.class_names = dict(names)

    def __len__(self) -> int:
        return len(self._native)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and meant(name, self.columns) in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    @overload
    def __getitem__(self, key: str) -> NDArray[Any]: ...

    @overload
    def __getitem__(self, key: Any) -> PointCloud: ...

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            return self._column(key)
        if isinstance(key, tuple) and len(key) == 2 and key[1] is Ellipsis:
            key = key[0]  # As scikit-learn indexes what has a shape.
        if isinstance(key, slice):
            return self.select(np.arange(len(self))[key])
        points = np.atleast_1d(unmasked(key, "points"))
        if points.size and (points.ndim != 1 or points.dtype.kind not in "biu"):
            raise TypeError(f"expected the name of a column, bools, indices or a slice, found {key!r}")
        # Negative indices count from the end, as in numpy.
        if points.dtype.kind != "i":
            return self.select(points)
        at = points.astype(np.int64)
        return self.select(np.where(at < 0, at + len(self), at))

    def _column(self, name: str) -> NDArray[Any]:
        called = meant(name, self.columns)
        at = axis(name)
        if at is not None and called not in self.columns:
            return _read_only(self._native.axis(at))
        if called not in self._views:
            values = self._native.column(called)
            if values is None:
                raise missing(name, self.columns)
            self._views[called] = values
        return self._views[called]

    def __setitem__(self, name: str, values: ArrayLike) -> None:
        if not isinstance(name, str):
            raise TypeError(f'expected the name of a column, found {name!r}; some points: cloud["name"][points] = values')
        called = meant(name, self.columns)
        if axis(name) is not None and called not in self.columns:
            raise ValueError(f"{name}: coordinates cannot be written; PointCloud(xyz) makes a cloud of other ones")
        values = unmasked(values, called)
        if values.ndim == 0:
            values = filled(values, self._native.column(called), len(self))
        self._put(called, values)

    def _put(self, name: str, values: ArrayLike) -> None:
        """Sets the column with exactly this name."""
        self._native.set_column(name, column(values, name, len(self)))
        self._views.pop(name, None)

    def __delitem__(self, name: str) -> None:
        called = meant(name, self.columns)
        if not self._native.remove_column(called):
            raise missing(name, self.columns)
        self._views.pop(called, None)

    def __repr__(self) -> str:
        return as_text(self)

    def _repr_html_(self) -> str:
        return as_html(self)

    def __reduce__(self) -> tuple[Any, ...]:
        core = self._core
        columns = {name: core.column(name) for name in self.columns}
        ticks = core.ticks()
        place = core.xyz() if ticks is None else ticks
        return _restore, (place, self.crs, self.metres_per_unit, columns, self.scheme, self.class_names)

    def to_pandas(self) -> Any:
        """The points as a ``pandas.DataFrame``: X, Y, Z and the columns; needs pandas.

        Reference system, unit and class list are in its ``attrs``, which pandas keeps when rows or columns are selected, so that
        a table that is classified or written has them too.

        Examples
        --------
        >>> import scansion
        >>> scansion.PointCloud([[1, 2, 3]], Classification=[2]).to_pandas().columns.tolist()
        ['X', 'Y', 'Z', 'Classification']
        """
        import pandas

        frame = pandas.DataFrame(rows(self))
        frame.attrs[ATTRS] = about(self)
        return frame

    def copy(self) -> PointCloud:
        """An independent copy."""
        return self._wrap(self._core.copy(), self._path)

    def select(self, points: ArrayLike) -> PointCloud:
        """Some of the points, with all their columns.

        Parameters
        ----------
        points : array_like of shape (n,), bool, or of indices
            Whether each point is selected, or the selected points in this order.

        Examples
        --------
        >>> import numpy as np
        >>> import scansion
        >>> cloud = scansion.PointCloud(np.eye(3), Classification=[2, 6, 2])
        >>> cloud.select(cloud["Classification"] == 2).xyz.tolist()
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
        >>> cloud.select([1, 0])["Classification"].tolist()
        [6, 2]
        """
        array = unmasked(points, "points")
        if array.dtype == np.bool_:
            array = np.flatnonzero(mask(array, "points", len(self)))
        array = column(array, "points")
        if array.size and (array.dtype.kind not in "iu" or array.min() < 0 or array.max() >= len(self)):
            raise IndexError(f"points: expected bool or indices below {len(self)}")
        return self._wrap(self._core.select(native(array, np.uint32)), self._path)

    @classmethod
    def from_laspy(cls, las: Any) -> PointCloud:
        """A cloud from a ``laspy.LasData``: its exact integers, its dimensions and its reference system."""
        return from_laspy(cls, las)

    def to_laspy(self) -> Any:
        """The cloud as ``laspy.LasData`` of LAS 1.4; needs the extra ``scansion[las]``.

        Scan angles are rounded to steps of 0.006 degrees.

        Raises
        ------
        ValueError
            A value does not fit its dimension of LAS, such as a class code above 255, an intensity above 65,535, a
            fraction or NaN. `scansion.write` scales such intensities or keeps them in an extra dimension.
        """
        return to_laspy(self)


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array


def _restore(
    place: Any,
    crs: str | None,
    metres_per_unit: float | None,
    columns: Mapping[str, NDArray[Any]],
    scheme: str = "own",
    class_names: Mapping[int, str] | None = None,
) -> PointCloud:
    """The inverse of ``PointCloud.__reduce__``."""
    core = _core.Cloud.from_ticks(*place) if isinstance(place, tuple) else _core.Cloud.from_xyz(place)
    cloud = PointCloud._wrap(core)
    cloud._fill(crs, metres_per_unit, columns)
    cloud.scheme = scheme
    cloud.class_names = class_names or {}
    return cloud


def measured(points: Any, columns: list[str], metres_per_unit: float | None) -> PointCloud:
    """`as_cloud` with another unit, if one is given; the caller's cloud is not changed."""
    cloud = as_cloud(points, columns=columns)
    if metres_per_unit is None:
        return cloud
    cloud = cloud.copy()
    cloud.metres_per_unit = metres_per_unit
    return cloud


def as_cloud(points: Any, *, columns: list[str] | None = None) -> PointCloud:
    """Anything that holds points as a `PointCloud`.

    Parameters
    ----------
    points : PointCloud, path, laspy.LasData, pandas.DataFrame, structured array or array_like of shape (n, 3)
        A structured array or a table needs the fields X, Y, Z (or x, y, z); its other fields become columns. A table that
        `PointCloud.to_pandas` made has the reference system, unit and class list of its cloud.
    columns : list of str, optional
        Columns to read if ``points`` is a path; all by default. If empty, those of a table are left out too, which may be text.
    """
    if isinstance(points, PointCloud):
        return points
    if isinstance(points, (str, os.PathLike)):
        name = os.fspath(points)
        return PointCloud._wrap(_core.read(name, (columns, None, None, [])), name)
    if hasattr(points, "point_format") and hasattr(points, "header") and hasattr(points, "X"):
        return PointCloud.from_laspy(points)
    table = hasattr(points, "columns") and hasattr(points, "to_numpy")
    fields = list(points.columns) if table else getattr(getattr(points, "dtype", None), "names", None)
    if fields is None or (table and len(fields) == 3 and not {"x", "X"} & set(fields)):
        return PointCloud(points)
    for axes in (("X", "Y", "Z"), ("x", "y", "z")):
        if all(axis in fields for axis in axes):
            cloud = PointCloud(np.column_stack([unmasked(points[axis], axis, np.float64) for axis in axes]))
            ours = our_names(str(name) for name in fields)
            for name in fields:
                if name not in axes and columns != []:
                    cloud._put(ours[str(name)], points[name])
            if table:
                take_about(cloud, getattr(points, "attrs", {}).get(ATTRS))
            return cloud
    kind, alone = ("table", "a table of these three") if table else ("structured array", "an (n, 3) array")
    advice = f"rename the fields of the coordinates, or give {alone} alone"
    found = ", ".join(map(str, fields)) or "none"
    raise ValueError(f"{kind}: expected the fields X, Y, Z or x, y, z, found {found}; {advice}")
