"""Metadata routing of scikit-learn: which arguments meta-estimators hand on to ``fit`` and ``score``.

scikit-learn derives the requests of its own estimators from their base class, which would have to be imported.
"""

from __future__ import annotations

import copy
from typing import Any, TypeVar

Self = TypeVar("Self", bound="Routed")

UNCHANGED = "$UNCHANGED$"
"""The value of an argument that was not given, as in scikit-learn."""


class Routed:
    """An estimator whose ``fit`` takes weights of samples."""

    _weighted: tuple[str, ...] = ("fit",)
    """Methods that take ``sample_weight``."""

    def get_metadata_routing(self) -> Any:
        """The ``MetadataRequest`` of scikit-learn: which arguments this estimator asks for."""
        from sklearn.utils.metadata_routing import MetadataRequest

        asked = self.__dict__.get("_metadata_request")
        if asked is not None:
            return copy.deepcopy(asked)
        request = MetadataRequest(owner=type(self).__name__)
        for method in self._weighted:
            getattr(request, method).add_request(param="sample_weight", alias=None)
        return request

    _get_metadata_request = get_metadata_routing

    def set_fit_request(self: Self, *, sample_weight: bool | str | None = UNCHANGED) -> Self:
        """Whether meta-estimators of scikit-learn hand ``sample_weight`` to `fit`; needs ``enable_metadata_routing``.

        Parameters
        ----------
        sample_weight : bool, str or None
            True: they do if it is given, False: they do not, None: it is an error if it is given, text: its name there. What was
            asked for before stays without this argument.
        """
        return self._request("fit", sample_weight)

    def _request(self: Self, method: str, alias: bool | str | None) -> Self:
        from sklearn import get_config

        if not get_config().get("enable_metadata_routing", False):
            raise RuntimeError(
                "This method is only available when metadata routing is enabled. You can enable it using "
                "sklearn.set_config(enable_metadata_routing=True)."
            )
        if alias == UNCHANGED:
            return self
        request = self.get_metadata_routing()
        getattr(request, method).add_request(param="sample_weight", alias=alias)
        self._metadata_request = request
        return self


class RoutedInScore(Routed):
    """An estimator whose ``score`` takes weights of samples too."""

    _weighted = ("fit", "score")

    def set_score_request(self: Self, *, sample_weight: bool | str | None = UNCHANGED) -> Self:
        """Whether meta-estimators of scikit-learn hand ``sample_weight`` to `score`, as `set_fit_request`.

        Parameters
        ----------
        sample_weight : bool, str or None
            As in `set_fit_request`.
        """
        return self._request("score", sample_weight)
