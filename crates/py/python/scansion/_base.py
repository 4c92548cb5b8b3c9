"""The scikit-learn protocol without scikit-learn: parameters, tags, errors.

scikit-learn is imported only when it asks for tags or is loaded already, so that importing scansion is fast and needs
only numpy.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterable, Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Self = TypeVar("Self", bound="Estimator")


class NotFittedError(ValueError, AttributeError):
    """The estimator was used before ``fit``."""


class DataConversionWarning(UserWarning):
    """An input was converted to another shape or type."""


def from_sklearn(own: type[Any]) -> type[Any]:
    """scikit-learn's class with the same name if it is loaded, so that its users can catch it; else our own."""
    exceptions = sys.modules.get("sklearn.exceptions")
    found: type[Any] = getattr(exceptions, own.__name__, own)
    return found


def _short(value: Any) -> str:
    """How a parameter is shown: of a long text the first line."""
    if isinstance(value, str) and "\n" in value:
        return f"{value.splitlines()[0] + '...'!r}"
    return repr(value)


def lasting(values: Iterable[Any], name: str) -> Iterable[Any]:
    """A parameter that is a list, as an estimator keeps it: an iterator is refused, which is empty after its first use.

    >>> lasting((code for code in [0, 1]), "unlabelled")
    Traceback (most recent call last):
    TypeError: unlabelled: found a generator, which can be read only once, expected a list
    """
    if isinstance(values, Iterator):
        raise TypeError(f"{name}: found a {type(values).__name__}, which can be read only once, expected a list")
    return values


def logarithms(probabilities: NDArray[np.float32]) -> NDArray[np.float32]:
    """Natural logarithms; minus infinity of 0."""
    with np.errstate(divide="ignore"):
        found: NDArray[np.float32] = np.log(probabilities)
    return found


class Estimator:
    """An estimator for scikit-learn's clone and grid search. Parameters are the arguments of ``__init__``."""

    _fitted = ""
    """An attribute that only fitted estimators have."""
    _fits = "fit"
    """The method that fits."""

    @classmethod
    def _parameter_names(cls) -> list[str]:
        return sorted(name for name in inspect.signature(cls.__init__).parameters if name != "self")

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The parameters by name.

        Parameters
        ----------
        deep : bool
            Without effect: no parameter is itself an estimator.
        """
        return {name: getattr(self, name) for name in self._parameter_names()}

    def set_params(self: Self, **parameters: Any) -> Self:
        """Sets parameters by name; an unknown name is refused with the list of valid ones."""
        valid = self._parameter_names()
        for name, value in parameters.items():
            if name not in valid:
                raise ValueError(
                    f"Invalid parameter {name!r} for estimator {self!r}. Valid parameters are: {valid}."
                )
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        defaults = {name: p.default for name, p in inspect.signature(type(self).__init__).parameters.items()}
        given = self.get_params().items()
        changed = ", ".join(f"{k}={_short(v)}" for k, v in given if repr(v) != repr(defaults[k]))
        return f"{type(self).__name__}({changed})"

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, self._fitted)

    def _check_is_fitted(self) -> None:
        if not self.__sklearn_is_fitted__():
            name = type(self).__name__
            raise from_sklearn(NotFittedError)(
                f"This {name} instance is not fitted yet. Call {self._fits!r} with appropriate arguments before using this "
                "estimator."
            )


class Classifier(Estimator):
    """A classifier for scikit-learn's clone, grid search and pipelines."""

    _fitted = "classes_"

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, Tags, TargetTags

        return Tags(
            estimator_type="classifier",
            target_tags=TargetTags(required=True),
            classifier_tags=ClassifierTags(),
            transformer_tags=None,
            regressor_tags=None,
        )
