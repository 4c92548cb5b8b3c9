"""Networks of direct sparse convolutions that classify objects."""

from __future__ import annotations

import itertools
import json
import os
import re
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from scansion import _core
from scansion._arrays import to_json, unmasked
from scansion._base import Classifier, logarithms
from scansion._labels import check_kind
from scansion._progress import Progress, following
from scansion._settings import dotted_settings, seed, share, together, whole
from scansion.nn._samples import samples

Self = TypeVar("Self", bound="VoxelClassifier")

_NETWORKS = ("modelnet", "mnist", "modelnet-paper", "mnist-paper")


class VoxelClassifier(Classifier):
    """Classifies whole objects (images, occupied cells, clouds of points) by a sparse convolutional network.

    T. Hackel, *Large-scale Machine Learning for Point Cloud Processing*, ETH Zurich 2018, doi:10.3929/ethz-b-000264691,
    chapter 6: levels of direct sparse convolutions that keep only their strongest responses, max pooling of two cells along
    each axis after each (if their number is odd, the last is dropped), and two fully connected layers. The same data, settings
    and ``random_state`` give the same bytes, for any number of threads.

    Parameters
    ----------
    network : {"modelnet", "mnist", "modelnet-paper", "mnist-paper"}
        The network of the thesis: nine sparse and three dense convolutions along three axes, or six sparse ones along two.
        Its bounds of density are those of the resolution of the objects. Samples of "modelnet" are turned about the last axis
        in training (``learning.augment.turn``), digits of "mnist" are not, but shifted by up to a cell
        (``learning.augment.shift``). The names that end in ``-paper`` have the constants of the thesis for network and
        training: ModelNet40 with the density regulariser (its λ is 0.3), MNIST without.
    resolution : int
        Cells along each side of the cube into which clouds of points are put; objects that come in cells have their own.
    density : float, optional
        Upper bound of the share of the cells of a channel that keep a response, above 0, at most 1, instead of the network's.
    dense : bool
        Use dense convolutions only: the network's dense twin.
    epochs : int, optional
        Passes through the samples; None: those of the network, 30 (with the constants of the thesis 90 and 10).
    batch_size : int, optional
        Samples in a step; None: 32.
    learning_rate : float, optional
        Highest learning rate; None: that of the network, 0.01 for "modelnet" and 0.002 for "mnist" (with the constants of the
        thesis 0.001 and 0.01).
    settings : mapping, optional
        Any other setting, nested or with dotted keys: ``network.hidden``, ``network.levels``, ``network.attention``
        ("positive"; "magnitude" keeps responses by magnitude, of which the negative ones then become 0),
        ``learning.regulariser.strength`` (twice the λ of the thesis), ``learning.pruning``, ``learning.augment.turn`` and
        others; `settings_` lists all.
        ``learning.optimiser`` is a mapping of one name to its values, of which those that are absent are PyTorch's:
        ``{"adagrad": {"epsilon": 1e-10}}``, ``{"adadelta": {"rho": 0.9, "epsilon": 1e-6}}``,
        ``{"sgd": {"momentum": 0, "decay": 0}}`` or
        ``{"adam-w": {"beta1": 0.9, "beta2": 0.999, "epsilon": 1e-8, "decay": 0.01}}``.
    random_state : int, numpy.random.RandomState or None
        Seed; None means 0.
    n_jobs : int, optional
        Number of threads; None and -1 use all.

    Attributes
    ----------
    classes_ : array of shape (n_classes,)
    history_ : list of dict
        For each epoch ``loss``; ``densities`` of each sparse convolution, the share of the cells with a response above 0,
        before the strongest were selected; ``weights`` of sparse convolutions that are left; ``bytes`` of sparse tensors of a
        step; ``seconds``. Epochs before a checkpoint are not in it.
    settings_ : dict
        ``network`` and ``learning`` with all values.
    shape_ : dict
        ``channels`` and ``extent`` (cells along each axis) of an object.

    Examples
    --------
    >>> import numpy as np
    >>> from scansion import nn
    >>> draws = np.random.default_rng(0)
    >>> images = np.zeros((60, 12, 12))
    >>> upright = np.arange(60) % 2 == 1
    >>> for image, is_upright, at in zip(images, upright, draws.integers(2, 10, 60)):
    ...     image[(slice(2, 10), at) if is_upright else (at, slice(2, 10))] = 1
    >>> network = nn.VoxelClassifier("mnist", density=0.3, settings={"network.hidden": 16})
    >>> labels = np.where(upright, "upright", "lying")
    >>> network.fit(images, labels).score(images, labels) > 0.9
    True
    """

    classes_: NDArray[Any]
    history_: list[dict[str, Any]]
    settings_: dict[str, Any]
    shape_: dict[str, Any]

    def __init__(
        self,
        network: str = "modelnet",
        *,
        resolution: int = 32,
        density: float | None = None,
        dense: bool = False,
        epochs: int | None = None,
        batch_size: int | None = None,
        learning_rate: float | None = None,
        settings: Mapping[str, Any] | None = None,
        random_state: int | np.random.RandomState | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.network = network
        self.resolution = resolution
        self.density = density
        self.dense = dense
        self.epochs = epochs
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.settings = settings
        self.random_state = random_state
        self.n_jobs = n_jobs

    def fit(
        self: Self,
        X: Any,
        y: Any,
        *,
        checkpoint: str | os.PathLike[str] | None = None,
        progress: Progress = None,
    ) -> Self:
        """Trains on labelled objects.

        Parameters
        ----------
        X : array of shape (n, cells, ...), list of arrays of shape (m, 3), or SparseTensor
            Cells along 1 to 4 axes (one channel), clouds of points, or entries with any number of channels.
        y : array of shape (n,)
            Labels: whole numbers or texts.
        checkpoint : path, optional
            After each epoch all that is needed to go on is written to this file. If it exists already, training goes on from
            it and ends with a bit-identical network; it must be of the same objects and settings, and of no more epochs.
        progress : bool or callable, optional
            As `scansion.progress`.
        """
        labels, kind = _kind(y)
        classes, codes = np.unique(labels, return_inverse=True)
        objects, shape = samples(X, codes, whole(self.resolution, "resolution", 2))
        settings = self._settings(min(shape["extent"]))
        network, learning = to_json(settings["network"]), to_json(settings["learning"])
        training = _core.ObjectTraining(network, learning, objects, [str(name) for name in classes])
        path = None if checkpoint is None else os.fspath(checkpoint)
        if path is not None and os.path.exists(path):
            training.resume(path, objects)
            if training.epochs() > settings["learning"]["epochs"]:
                expected = f"at most the {settings['learning']['epochs']} to be done: raise epochs or use another file"
                raise ValueError(f"checkpoint: found {path} after {training.epochs()} epochs, expected {expected}")
        history: list[dict[str, Any]] = []
        with following(progress):
            while training.epochs() < settings["learning"]["epochs"]:
                start = time.perf_counter()
                report = json.loads(training.epoch(objects, self.n_jobs))
                history.append({**report, "seconds": time.perf_counter() - start})
                if path is not None:
                    training.save(path, objects)
        self._model = training.model(json.dumps(kind), self.network)
        self.classes_, self.shape_, self.settings_, self.history_ = classes, shape, settings, history
        return self

    def _settings(self, shortest: int) -> dict[str, Any]:
        """All settings under the core's names, for objects with so many cells along the shortest axis."""
        density = None if self.density is None else share(self.density, "density")
        own: dict[str, Any] = {"seed": seed(self.random_state)}
        if self.epochs is not None:
            own["epochs"] = whole(self.epochs, "epochs")
        if self.batch_size is not None:
            own["batch"] = whole(self.batch_size, "batch_size")
        if self.learning_rate is not None:
            own["rate"] = share(self.learning_rate, "learning_rate", (0, 1e6))
        given = together(self.settings)
        for key in given:
            if key not in ("network", "learning"):
                raise ValueError(f"settings: found {key}, expected network or learning")
        to_json(given)  # a number that is not finite is an error with its name
        changes = dotted_settings(own, "learning.") + dotted_settings(given)
        found: dict[str, Any] = json.loads(
            _core.object_preset(self.network, shortest, density, bool(self.dense), changes)
        )
        return found

    def predict_proba(self, X: Any) -> NDArray[np.float32]:
        """Probability of each class, shape (n, n_classes).

        Parameters
        ----------
        X
            Objects in a form that `fit` takes.
        """
        self._check_is_fitted()
        objects, _ = samples(X, None, self.shape_["extent"][0])
        return self._model.predict_proba(objects, self.n_jobs)

    def predict_log_proba(self, X: Any) -> NDArray[np.float32]:
        """Natural logarithm of `predict_proba`; minus infinity for a probability of 0.

        Parameters
        ----------
        X
            Objects in a form that `fit` takes.
        """
        return logarithms(self.predict_proba(X))

    def predict(self, X: Any) -> NDArray[Any]:
        """The most probable class of each object.

        Parameters
        ----------
        X
            Objects in a form that `fit` takes.
        """
        found: NDArray[Any] = self.classes_[self.predict_proba(X).argmax(axis=1)]
        return found

    def score(self, X: Any, y: Any) -> float:
        """Share of the objects whose class is found.

        Parameters
        ----------
        X
            Objects in a form that `fit` takes.
        y : array of shape (n,)
            Their labels, numbers or texts as for `fit`.
        """
        self._check_is_fitted()
        labels, _ = _kind(y)
        check_kind(labels, self.classes_, "y")
        found = self.predict(X)
        if len(labels) != len(found):
            raise ValueError(f"y: found {len(labels)} labels, expected {len(found)}")
        return float((found == labels).mean())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the network to a file, which :func:`scansion.nn.load_weights` reads too.

        Parameters
        ----------
        path : path
        """
        self._check_is_fitted()
        self._model.save(os.fspath(path))

    @classmethod
    def load(cls: type[Self], path: str | os.PathLike[str]) -> Self:
        """A network from a file that `save` wrote.

        Parameters are those that give a network of the same shape, so that a clone is fitted with it: `network`,
        `resolution`, `density`, `dense` and the rest in `settings`. The file has none of the training (epochs, learning rate,
        seed and others), which are those of `network`.

        Parameters
        ----------
        path : path
            A file of a version that did not store the type of labels has whole numbers as classes if all names are; `network`
            is the nearest where its name is not stored.
        """
        model = _core.ObjectModel.load(os.fspath(path))
        about = json.loads(model.about())
        own = cls(**_parameters(about["network"], about["shape"], about.get("preset")))
        own._model = model
        own.classes_ = _labels(about["classes"], about.get("labels"))
        own.shape_ = about["shape"]
        own.settings_ = {"network": about["network"]}
        return own

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """The parameters by name."""
        self._check_is_fitted()
        return self._model.weights()

    def __getstate__(self) -> dict[str, Any]:
        """The attributes, for copies and pickles; the network as the bytes of its file."""
        state = dict(self.__dict__)
        if "_model" in state:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, "network")
                self._model.save(os.fspath(path))
                state["_model"] = path.read_bytes()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """The inverse of ``__getstate__``."""
        self.__dict__.update(state)
        if "_model" in state:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, "network")
                path.write_bytes(state["_model"])
                self._model = _core.ObjectModel.load(os.fspath(path))


def _parameters(network: dict[str, Any], shape: dict[str, Any], known: str | None) -> dict[str, Any]:
    """The parameters that give such a network for objects of this shape, with as few settings as there can be; ``known`` is
    the name it was trained by."""
    extent, first = shape["extent"], network["levels"][0]["density"]
    levels: list[tuple[bool, float | None]] = [(False, None), (True, None)]
    if first != "none":
        levels.append((False, first))
    found: list[dict[str, Any]] = []
    names = (known,) if known in _NETWORKS else _NETWORKS
    for name, (dense, density) in itertools.product(names, levels):
        preset = json.loads(_core.object_preset(name, min(extent), density, dense))["network"]
        settings = {f"network.{key}": value for key, value in network.items() if preset[key] != value}
        found.append({"network": name, "density": density, "dense": dense, "settings": settings})
    # Of networks that are equally near, that of digits is for pictures.
    found.sort(key=lambda parameters: parameters["network"].startswith("mnist") != (len(extent) == 2))
    fewest = min(found, key=lambda parameters: len(parameters["settings"]))
    cube = {"resolution": extent[0]} if extent == extent[:1] * 3 else {}
    return {**fewest, "settings": fewest["settings"] or None, **cube}


def _kind(y: Any) -> tuple[NDArray[Any], str]:
    """The labels as numbers or texts, and which of them they are, by the core's name."""
    labels = unmasked(y, "y")
    if labels.ndim != 1:
        raise ValueError(f"y: found shape {labels.shape}, expected (n,)")
    if labels.dtype.kind == "O":
        if all(isinstance(label, str) for label in labels):
            labels = labels.astype(np.str_)
        elif all(isinstance(label, (int, np.integer)) and not isinstance(label, bool) for label in labels):
            labels = np.array([int(label) for label in labels])
    kinds = {"i": "whole", "u": "whole", "b": "boolean", "U": "text"}
    if labels.dtype.kind not in kinds:
        raise ValueError(f"y: found dtype {labels.dtype}, expected whole numbers or texts")
    return labels, kinds[labels.dtype.kind]


def _labels(names: list[str], kind: str | None) -> NDArray[Any]:
    """The labels with these names; without a kind, they are whole numbers if all names are."""
    if kind is None:
        kind = "whole" if all(re.fullmatch("-?[0-9]+", name) for name in names) else "text"
    if kind == "boolean":
        return np.array([name == "True" for name in names])
    return np.array([int(name) for name in names] if kind == "whole" else names)
