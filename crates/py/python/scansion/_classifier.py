"""Training on labelled clouds and classification of clouds."""

from __future__ import annotations

import inspect
import json
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import column
from scansion._base import Classifier, lasting, logarithms
from scansion._cloud import PointCloud, as_cloud
from scansion._labels import (
    check_kind,
    classes_of,
    encoded,
    is_text,
    listed,
    no_classes,
    numbers,
    signed,
    texts,
)
from scansion._model_file import Notes, add_notes, notes
from scansion._progress import Progress, following
from scansion._routing import Routed
from scansion._settings import dotted_settings
from scansion._settings import recipe as read_recipe
from scansion._settings import seed

LABELS = "Classification"
WEIGHT = "SampleWeight"
_WEIGHING = f'training.weight="{WEIGHT}"'
"""The setting of recipes that learn from weights of points."""

Self = TypeVar("Self", bound="PointClassifier")


class Classified(NamedTuple):
    """The classification, one entry a point in the cloud's order."""

    codes: NDArray[np.uint8]
    """Code of the most probable class. Points whose coordinates are not finite get 1 (unclassified), or 0 if 1 is a
    class, or the highest unused code if 0 is a class too. Stray points get 7 (noise) from models with ASPRS codes, else
    the same code."""
    confidence: NDArray[np.float32]
    """Its probability, 0..1."""
    entropy: NDArray[np.float32]
    """Entropy of the probabilities in nats, 0..ln(classes)."""
    probabilities: NDArray[np.float32] | None
    """Probability of every class, shape (n, classes), if requested."""


class PointClassifier(Routed, Classifier):
    """Classifies every point of a cloud by multi-scale features and a random forest.

    T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich 2018, doi:10.3929/ethz-b-000264691,
    chapter 4.4.

    Parameters
    ----------
    recipe : path, str or mapping, optional
        A TOML recipe: its path, its text, a name, or a mapping of keys (nested or dotted) to values, as in
        ``{"forest.trees": 100, "features.intensity": True}``. By default as in the thesis, except
        for rare classes.
    unlabelled : iterable of int or str, optional
        Labels that mean "unlabelled"; such points are not used for training. By default those of the cloud's class list (LAS:
        0 and 1, Semantic3D: 0, others: none; see `PointCloud.scheme`), also for codes that are given as an array beside the
        cloud; a cloud that is an array has no list. ``[]`` makes every code a class. Negative labels, NaN and None are always
        unlabelled.
    class_map : str
        Mapping of codes before training, as in ``"3-4=5"``.
    random_state : int, numpy.random.RandomState or None
        Seed; None uses the recipe's (0 if it has none).
    n_jobs : int, optional
        Number of threads; None and -1 use all. Results do not depend on it.

    Attributes
    ----------
    classes_ : array of shape (n_classes,)
        Class codes, ascending; the texts if ``fit`` was given text.
    codes_ : array of shape (n_classes,)
        The code of each class in files and in the result of `classify`.
    class_names_ : list of str
    feature_names_in_ : array of shape (n_features,)
        Features that occur in the forest.
    feature_importances_ : array of shape (n_features,)
        Mean decrease of impurity, summing to 1.
    recipe_ : str
        The recipe as TOML, with all values written out.
    report_ : dict
        Report of the training: points, samples and weight of each class, ``warnings``, and more; only after ``fit``.
    regularisation_ : dict or None
        How the regularisation of the labels was chosen: ``method``, ``strength``, and ``candidates`` with the scores of
        each; None if the recipe names a method. Only after ``fit``.
    cars_report_ : dict
        Points of cars, and samples of cars and of other things, that `add_cars` has learned from; only after it.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import PointClassifier
    >>> ground = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), -1).reshape(-1, 3)
    >>> wall = np.stack(np.meshgrid([0.0], np.arange(20.0), np.arange(1.0, 21.0)), -1).reshape(-1, 3)
    >>> cloud = np.concatenate([ground, wall])
    >>> labels = np.repeat([2, 6], 400)
    >>> recipe = {"features.pyramid.first_scale": 1.0, "features.pyramid.levels": 2, "forest.trees": 10}
    >>> classifier = PointClassifier(recipe).fit(cloud, labels)
    >>> bool((classifier.predict(cloud) == labels).mean() > 0.95)
    True
    >>> texts = PointClassifier(recipe).fit(cloud, np.where(labels == 2, "ground", "wall")).predict(cloud)
    >>> sorted(set(texts.tolist()))
    ['ground', 'wall']
    """

    classes_: NDArray[Any]
    codes_: NDArray[np.uint8]
    class_names_: list[str]
    feature_names_in_: NDArray[np.object_]
    recipe_: str
    report_: dict[str, Any]
    regularisation_: dict[str, Any] | None
    cars_report_: dict[str, Any]
    _model: _core.Model

    def __init__(
        self,
        recipe: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        *,
        unlabelled: Iterable[Any] | None = None,
        class_map: str = "",
        random_state: int | np.random.RandomState | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.recipe = recipe
        self.unlabelled = unlabelled
        self.class_map = class_map
        self.random_state = random_state
        self.n_jobs = n_jobs

    @classmethod
    def default(cls) -> PointClassifier:
        """The built-in model for airborne scans: ground (2), vegetation (5), building (6); `classify` divides further.

        Its recipe is ``airborne``, which clones of it are fitted with too. Where the truth has low, medium and high vegetation
        (3, 4, 5), compare `predict` with ``evaluation.report(..., map_truth="3-4=5")``, or use `classify`.

        It has no class for bridges, masts, water and cars, which become ground, building or vegetation; a `UserWarning` of
        all methods that classify says so (``warnings.filterwarnings("ignore", "the built-in model has no class")`` hides it).
        `classify` leaves the cars, water and decks of bridges that it finds unclassified, and warns of places that may be decks
        of bridges. Clouds that are unlike those of the training are warned of, too.

        Examples
        --------
        >>> from scansion import PointClassifier
        >>> PointClassifier.default()
        PointClassifier(recipe='airborne')
        """
        return cls("airborne")._take(_core.Model.default())

    @classmethod
    def load(cls: type[Self], path: str | os.PathLike[str]) -> Self:
        """A classifier from a model file that ``save`` or ``scansion train`` wrote.

        ``recipe`` is that of the model as TOML, and ``class_map`` and ``unlabelled`` are those that `save` found, so that scores
        are the same and a clone is fitted as the model was. Models of ``scansion train`` have neither.

        Parameters
        ----------
        path : path
        """
        model = _core.Model.load(os.fspath(path))
        noted = notes(path)
        recipe = _without_weights(model.recipe())
        loaded = cls(recipe, class_map=noted.class_map, unlabelled=noted.unlabelled)._take(model)
        if noted.text:
            loaded.classes_ = np.array(loaded.class_names_)
        return loaded

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model to a file, which ``scansion classify --model`` can use too.

        That the labels were text, ``class_map`` and ``unlabelled`` are kept for `load`.

        Parameters
        ----------
        path : path
            An existing model is replaced; any other existing file is not.

        Raises
        ------
        FileExistsError
            If the file exists and is not a model.
        """
        self._check_is_fitted()
        noted = Notes(self.classes_.dtype.kind == "U", self.class_map, None if self.unlabelled is None else self._unlabelled())
        self._model.save(os.fspath(path))
        add_notes(path, noted)

    def fit(
        self: Self,
        clouds: Any,
        labels: Any = None,
        *,
        sample_weight: Any = None,
        elevation_model: str | os.PathLike[str] | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        progress: Progress = None,
    ) -> Self:
        """Trains on labelled clouds.

        Parameters
        ----------
        clouds : cloud or list of clouds
            Each a PointCloud, path, laspy.LasData, structured array or array of shape (n, 3).
        labels : array_like of shape (n,) or list of such, optional
            Class codes 0..255 of the cloud's class list (negative: unlabelled; see ``unlabelled``), or text (None: unlabelled);
            by default each cloud's column Classification.
        sample_weight : array_like of shape (n,) or list of such, optional
            Weight of each point, 0 or more; points of weight 0 are not learned from. As ``training.weight``, which names a
            column; not for the recipes weak and objects.
        elevation_model : path, optional
            Ground heights to use instead of those of the road, an ESRI ASCII grid in the unit of the cloud; for the recipe weak.
        checkpoint : path, optional
            File that training writes from time to time and goes on from if it exists, to the same model; for the recipes unet and windows.
        progress : bool or callable, optional
            Show the progress, as `scansion.progress`.

        Warns about classes that were left out because they have too few points, about rare ones, and about ``labels`` that the
        class list of the cloud takes as unlabelled.
        """
        recipe, settings = self._recipe()
        weights = None if sample_weight is None else _listed_clouds(clouds, sample_weight, "sample_weight")[1]
        clouds, given = _listed_clouds(clouds, labels)
        given, names, unlabelled = self._known(given)
        if weights is not None:
            settings = [*settings, _WEIGHING]
            clouds = [_weighted(cloud, w) for cloud, w in zip(clouds, weights, strict=True)]
        wanted = _columns(recipe, settings)
        reading = Reading(wanted, self.class_map, listed=self.unlabelled is None, names=names)
        prepared = [_labelled(cloud, y, reading) for cloud, y in zip(clouds, given, strict=True)]
        with following(progress):
            model, report = _core.Model.train(
                [cloud._core for cloud in prepared],
                recipe,
                settings,
                LABELS,
                self.class_map,
                unlabelled,
                names,
                self._strengths(),
                _path(elevation_model),
                _path(checkpoint),
                self.n_jobs,
            )
        self._take(model)
        if names:
            self.classes_ = np.array(self.class_names_)
        self.report_ = json.loads(report)
        self.regularisation_ = self.report_.get("regularisation")
        for note in self.report_["warnings"]:
            warnings.warn(note, stacklevel=2)
        return self

    def add_cars(self: Self, clouds: Any, labels: Any = None, *, code: int, progress: Progress = None) -> Self:
        """Teaches the fitted model, one of the recipe airborne, to find cars; what it says about other points stays.

        The model is changed and returned. `classify` leaves cars unclassified. Only points that the model takes for vegetation
        or buildings, 0.2 to 3 m above the ground, are learned from and looked at. As ``scansion train --add-cars-to``.

        Parameters
        ----------
        clouds, labels
            As in `fit`; numbers only.
        code : int
            The code of cars, 0..255; all other labelled points are other things.
        progress : bool or callable, optional
            Show the progress, as `scansion.progress`.

        Raises
        ------
        ValueError
            If the model is of another recipe, or there are no cars, or nothing else, among these points.

        Examples
        --------
        >>> from scansion import PointClassifier
        >>> model = PointClassifier.default()
        >>> model.add_cars("streets.laz", code=64).classify("other.laz")  # doctest: +SKIP
        """
        self._check_is_fitted()
        if not 0 <= code <= 255:
            raise ValueError(f"code: found {code}, expected 0 to 255")
        if self.classes_.dtype.kind == "U":
            raise ValueError("cars: found classes that are text, expected a model with the codes of ASPRS")
        clouds, given = _listed_clouds(clouds, labels)
        if any(y is not None and is_text(y) for y in given):
            raise ValueError("labels: found text, expected codes")
        reading = Reading(_core.recipe_columns(self.recipe_, []), self.class_map, listed=self.unlabelled is None)
        prepared = [_labelled(cloud, y, reading) for cloud, y in zip(clouds, given, strict=True)]
        unlabelled = None if self.unlabelled is None else listed(self._unlabelled())
        with following(progress):
            model, report = self._model.with_cars(
                [cloud._core for cloud in prepared], LABELS, self.class_map, code, unlabelled, self.n_jobs
            )
        self._model = model
        self.recipe_ = model.recipe()
        self.cars_report_ = json.loads(report)
        return self

    def _unlabelled(self) -> Iterable[Any]:
        """Labels that mean "unlabelled"; none if the class list of a cloud tells them."""
        return () if self.unlabelled is None else lasting(self.unlabelled, "unlabelled")

    def _known(self, given: list[Any]) -> tuple[list[Any], list[str], bytes | None]:
        """Labels as numbers; the names of the codes if they were text; the codes that mean "unlabelled"."""
        if not any(y is not None and is_text(y) for y in given):
            return given, [], None if self.unlabelled is None else listed(self._unlabelled())
        if self.class_map:
            raise ValueError(f"class_map: found {self.class_map!r}, expected none: the labels are text")
        arrays = [texts(y, "labels") for y in given]
        names = classes_of(arrays, self._unlabelled())
        return [encoded(y, names) for y in arrays], names, b""

    def classify(
        self,
        cloud: Any,
        *,
        probabilities: bool = False,
        regularize: str | None = None,
        metres_per_unit: float | None = None,
        elevation_model: str | os.PathLike[str] | None = None,
        abstain: float | None = None,
        divided: bool = True,
        settings: Mapping[str, Any] | None = None,
        progress: Progress = None,
    ) -> Classified:
        """Class, confidence and entropy of every point.

        Parameters
        ----------
        cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        probabilities : bool
            Also return the probability of every class.
        regularize : {"none", "local", "point-crf", "consensus", "segment-crf"}, optional
            Method of regularisation; None uses the model's own.
        metres_per_unit : float, optional
            Metres per unit of the coordinates; None uses the cloud's own unit, else 1. Degrees are an error.
        elevation_model : path, optional
            Ground heights to use instead of those of the road, an ESRI ASCII grid in the unit of the cloud; for the recipe weak.
        abstain : float, optional
            Points of less confidence, 0..1, get the code of unclassified points; None uses the recipe's.
        divided : bool
            Apply the rules of the recipe: the built-in model's vegetation becomes low, medium and high
            (3, 4, 5), isolated points noise (7, 18), wires 14, and cars, water and decks unclassified (1). Otherwise,
            as in `predict`, only ``codes_`` occur.
        settings : mapping, optional
            Settings of the model's recipe to change, e.g. ``{"classes.cars.points": 0}``, which looks for no cars. Those of
            training only are an error; the rules, ``classes``, only count with ``divided``.
        progress : bool or callable, optional
            Show the progress, as `scansion.progress`.
        """
        self._check_is_fitted()
        points = as_cloud(cloud, columns=_core.recipe_columns(self.recipe_, []))
        grid = _path(elevation_model)
        with following(progress):
            found = self._model.classify(
                points._core,
                probabilities,
                regularize,
                metres_per_unit,
                grid,
                abstain,
                divided,
                dotted_settings(settings or {}),
                self.n_jobs,
            )
        for note in found[4]:
            _warn_caller(note)
        return Classified(*found[:4])

    def predict(self, cloud: Any, *, regularize: str | None = None, progress: Progress = None) -> NDArray[Any]:
        """The class of every point, in the cloud's order: its code, or its text if ``fit`` was given text ("" where
        coordinates are not finite).

        The rules of the recipe are not applied: the built-in model names bridges ground, building or vegetation, whether
        `classify` finds them or not, and no warning names their places.

        Parameters
        ----------
        cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        regularize, progress
            As in `classify`.
        """
        found = self.classify(cloud, divided=False, regularize=regularize, progress=progress).codes
        return self._texts(found) if self.classes_.dtype.kind == "U" else found

    def _texts(self, found: NDArray[np.uint8]) -> NDArray[np.str_]:
        """The names of codes, "" for codes that are not a class."""
        names = np.full(256, "", dtype=np.array(self.class_names_).dtype)
        names[self.codes_] = self.class_names_
        return np.asarray(names[found])

    def predict_proba(
        self, cloud: Any, *, regularize: str | None = None, progress: Progress = None
    ) -> NDArray[np.float32]:
        """Probability of each class for every point, columns in the order of ``classes_``.

        With regularisation, and with the recipes ``unet``, ``windows``, ``spheres``, ``clusters``, ``weak`` and ``contours``
        also without, p becomes (1 - a) p + a / classes, where a is ``regularise.smoothing`` (0.01).

        Parameters
        ----------
        cloud : PointCloud, path, laspy.LasData, structured array or array_like of shape (n, 3)
        regularize, progress
            As in `classify`.
        """
        found = self.classify(cloud, probabilities=True, divided=False, regularize=regularize, progress=progress).probabilities
        assert found is not None
        return found

    def predict_log_proba(
        self, cloud: Any, *, regularize: str | None = None, progress: Progress = None
    ) -> NDArray[np.float32]:
        """Natural logarithm of `predict_proba`; minus infinity for a probability of 0.

        Parameters
        ----------
        cloud, regularize, progress
            As in `predict_proba`.
        """
        return logarithms(self.predict_proba(cloud, regularize=regularize, progress=progress))

    def score(self, clouds: Any, labels: Any = None, *, regularize: str | None = None) -> float:
        """Accuracy: share of the labelled points that are classified correctly, 0..1.

        Parameters
        ----------
        clouds : cloud or list of clouds
            As for ``fit``: each a PointCloud, path, laspy.LasData, structured array or array of shape (n, 3).
        labels : array_like of shape (n,) or list of such, optional
            Class codes or text as for ``fit``; by default each cloud's column Classification. ``unlabelled``, or else the class
            list of each cloud, and ``class_map`` are applied as in ``fit``.
        regularize : str, optional
            As in `classify`.
        """
        self._check_is_fitted()
        counts = [self._right(cloud, y, regularize) for cloud, y in zip(*_listed_clouds(clouds, labels), strict=True)]
        right, known, points = (sum(count) for count in zip(*counts, strict=True))
        if not known:
            raise ValueError(f"labels: found no label among {points} points, expected some to score by")
        return float(right / known)

    def _right(self, cloud: Any, labels: Any, regularize: str | None) -> tuple[int, int, int]:
        """Labelled points that are classified correctly, all labelled points, and all points of a cloud."""
        points = as_cloud(cloud)
        if labels is not None:
            check_kind(labels, self.classes_, "labels")
        unlabelled = self._unlabelled()
        if labels is not None and is_text(labels):
            true = texts(labels, "labels", len(points))
            skipped = no_classes(unlabelled)
            known = np.array([text not in skipped for text in true.tolist()], dtype=bool)
            found: NDArray[Any] = self._texts(self.classify(points, divided=False, regularize=regularize).codes)
            return int((found[known] == true[known].astype(str)).sum()), int(known.sum()), len(points)
        if self.unlabelled is None:
            unlabelled = points._core.unlabelled()
        given = points[LABELS] if labels is None else labels
        codes = signed(given, "labels", len(points), unlabelled, self.class_map)
        known = codes >= 0
        if not known.any():
            return 0, 0, len(points)
        found = self.classify(points, divided=False, regularize=regularize).codes
        return int((found == codes)[known].sum()), int(known.sum()), len(points)

    @property
    def feature_importances_(self) -> NDArray[np.float64]:
        """Mean decrease of impurity by feature, summing to 1."""
        self._check_is_fitted()
        return self._model.importance()

    def _strengths(self) -> list[float]:
        """Strengths to choose from; used by the weak recipe only."""
        return []

    def _take(self: Self, model: _core.Model) -> Self:
        self.__dict__.pop("cars_report_", None)
        self._model = model
        self.codes_ = np.array(model.codes(), dtype=np.uint8)
        self.classes_ = self.codes_
        self.class_names_ = model.class_names()
        self.feature_names_in_ = np.array(model.feature_names(), dtype=object)
        self.recipe_ = model.recipe()
        return self

    def _recipe(self) -> tuple[str, list[str]]:
        """The recipe's TOML and the settings on top of it."""
        text, settings = read_recipe(self.recipe)
        if self.random_state is not None:
            settings.append(f"seed={seed(self.random_state)}")
        return text, settings


def _without_weights(recipe: str) -> str:
    """The recipe of a model without the weights that ``fit`` was given."""
    return recipe.replace(f'weight = "{WEIGHT}"', 'weight = "none"')


def _columns(recipe: str, settings: list[str]) -> list[str]:
    """Columns that a recipe needs; weights of points are refused if it does not learn from them."""
    try:
        return _core.recipe_columns(recipe, settings)
    except ValueError:
        if _WEIGHING not in settings:
            raise
        # Whatever else is wrong with the recipe is said first.
        _core.recipe_columns(recipe, [setting for setting in settings if setting != _WEIGHING])
    raise ValueError("sample_weight: found weights, expected None: this recipe does not learn from weights of points")


def _path(path: str | os.PathLike[str] | None) -> str | None:
    return None if path is None else os.fspath(path)


def _listed_clouds(clouds: Any, labels: Any, name: str = "labels") -> tuple[list[Any], list[Any]]:
    """The clouds, and the labels of each (None: its own)."""
    several = isinstance(clouds, (list, tuple)) and not _is_rows(clouds)
    clouds = list(clouds) if several else [clouds]
    given = [None] * len(clouds) if labels is None else list(labels) if several else [labels]
    if len(given) != len(clouds):
        raise ValueError(f"{name}: found {len(given)} arrays for {len(clouds)} clouds")
    return clouds, given


class Reading(NamedTuple):
    """How the labels of clouds are read."""

    columns: list[str]
    """Columns that are needed besides the labels."""
    class_map: str
    listed: bool
    """Whether the class list of a cloud says which codes are unlabelled."""
    names: Sequence[str] = ()
    """What the codes from 0 on stand for if the labels are text, so that no class list has them."""


def labelled_clouds(clouds: Any, labels: Any, reading: Reading) -> list[PointCloud]:
    """The clouds with the columns, and their labels in the column Classification."""
    return [_labelled(cloud, y, reading) for cloud, y in zip(*_listed_clouds(clouds, labels), strict=True)]


def _is_rows(values: list[Any] | tuple[Any, ...]) -> bool:
    """Whether a list is one cloud written as rows of x, y, z."""
    # A PointCloud is a sequence of the names of its columns, which may be three.
    first = values[0] if len(values) > 0 else None
    return first is not None and not isinstance(first, PointCloud) and np.shape(first) == (3,)


def _weighted(cloud: Any, weights: Any) -> PointCloud:
    """The cloud with the weights of its points in a column."""
    points = as_cloud(cloud).copy()
    points._put(WEIGHT, column(weights, "sample_weight", len(points)).astype(np.float32))
    return points


def _labelled(cloud: Any, labels: Any, reading: Reading) -> PointCloud:
    """The cloud with its labels in the column Classification."""
    points = as_cloud(cloud, columns=[*reading.columns, LABELS])
    if labels is None and LABELS not in points.columns and LABELS in points:
        labels = points[LABELS]  # The column has another spelling.
    if labels is not None:
        labels = numbers(labels, "labels")
        if reading.listed and not reading.names:
            _warn_of_unlabelled(points, labels, reading.class_map)
        points = points.copy()
        points._put(LABELS, column(labels, "labels", len(points)))
        if reading.names:
            points.scheme, points.class_names = "own", dict(enumerate(reading.names))
    if LABELS in points:
        signed(points[LABELS], "labels", None, (), reading.class_map)  # Its errors are in words of Python.
    return points


def _warn_caller(text: str) -> None:
    """Warns at the line outside this package from which the call came."""
    frame, level = inspect.currentframe(), 0
    while frame is not None and frame.f_globals.get("__package__") == __package__:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level + 1)


def _warn_of_unlabelled(points: PointCloud, labels: Any, class_map: str) -> None:
    """Warns of codes that the class list takes as unlabelled, but that the cloud's own column does not have there."""
    codes = signed(labels, "labels", len(points), (), class_map)
    lost = np.isin(codes, points._core.unlabelled())
    if LABELS in points:
        lost &= np.asarray(points[LABELS] != labels)
    if lost.any():
        which = " and ".join(map(str, np.unique(codes[lost]).tolist()))
        warnings.warn(
            f"labels: {lost.sum():,} points of code {which} count as unlabelled, as the class list of the cloud has it "
            f"(scheme {points.scheme!r}); unlabelled=[] makes every code a class",
            stacklevel=5,
        )
