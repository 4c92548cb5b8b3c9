"""Module `classification`: boosted and bagged trees against scikit-learn's checks and its own classifiers."""

import pickle

import numpy as np
import pytest
from scansion import BaggingClassifier, GradientBoostingClassifier
from sklearn.base import clone, is_classifier
from sklearn.datasets import load_breast_cancer, load_digits, load_iris, load_wine
from sklearn.ensemble import BaggingClassifier as BaggingPeer
from sklearn.ensemble import HistGradientBoostingClassifier as BoostingPeer
from sklearn.model_selection import GridSearchCV, cross_val_score, train_test_split
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

WEIGHTS = (
    "quantiles are taken from rows, not from weights, and a leaf's samples are counted, as in scikit-learn"
)
SAMPLED = "bootstrap samples differ where rows are repeated, as in scikit-learn's own bagging"


def expected_failures(estimator):
    """What scikit-learn expects of its own classifiers of these kinds too."""
    reason = SAMPLED if isinstance(estimator, BaggingClassifier) else WEIGHTS
    return {"check_sample_weight_equivalence_on_dense_data": reason}


@parametrize_with_checks(
    [GradientBoostingClassifier(n_estimators=10, min_samples_leaf=5), BaggingClassifier(n_estimators=10)],
    expected_failed_checks=expected_failures,
)
def test_scikit_learn_checks_pass(estimator, check):
    check(estimator)


@pytest.mark.parametrize("load", [load_iris, load_wine, load_digits, load_breast_cancer])
def test_accuracy_is_that_of_scikit_learn(load):
    X, y = load(return_X_y=True)
    scores = {"boosting": [], "boosting peer": [], "bagging": [], "bagging peer": []}
    for state in range(3):
        a, b, c, d = train_test_split(X, y, test_size=0.4, random_state=state, stratify=y)
        scores["boosting"].append(GradientBoostingClassifier(30).fit(a, c).score(b, d))
        scores["boosting peer"].append(BoostingPeer(max_iter=30, early_stopping=False).fit(a, c).score(b, d))
        scores["bagging"].append(BaggingClassifier(30, random_state=state).fit(a, c).score(b, d))
        scores["bagging peer"].append(BaggingPeer(n_estimators=30, random_state=state).fit(a, c).score(b, d))
    mean = {name: np.mean(values) for name, values in scores.items()}
    assert abs(mean["boosting"] - mean["boosting peer"]) < 0.02, mean
    assert abs(mean["bagging"] - mean["bagging peer"]) < 0.02, mean


@pytest.mark.parametrize("make", [GradientBoostingClassifier, BaggingClassifier])
def test_the_same_bytes_for_any_number_of_threads_and_after_pickling(make):
    X, y = load_wine(return_X_y=True)
    made = [make(20, n_jobs=n).fit(X, y) for n in (1, 2, 3)]
    assert len({trees.predict_proba(X).tobytes() for trees in made}) == 1
    assert len({pickle.dumps(trees._trees) for trees in made}) == 1
    assert (
        pickle.loads(pickle.dumps(made[0])).predict_proba(X).tobytes() == made[0].predict_proba(X).tobytes()
    )


def test_losses_fall_and_early_stopping_keeps_the_best_round():
    X, y = load_digits(return_X_y=True)
    trees = GradientBoostingClassifier(20).fit(X, y)
    assert (np.diff(trees.train_score_) < 0).all() and len(trees.validation_score_) == 0
    random = np.random.default_rng(0)
    noisy = np.where(random.random(len(y)) < 0.3, random.integers(0, 10, len(y)), y)
    trees = GradientBoostingClassifier(300, learning_rate=0.3, n_iter_no_change=5).fit(X, noisy)
    assert trees.n_estimators_ == trees.validation_score_.argmin() < 300


def test_missing_values_are_learned_from_and_infinity_is_refused():
    random = np.random.default_rng(0)
    X = random.normal(size=(600, 3))
    y = X[:, 0] > 0
    X[y & (random.random(600) < 0.5), 0] = np.nan
    trees = GradientBoostingClassifier(30).fit(X, y)
    assert trees.score(X, y) > 0.98 and trees.predict([[np.nan, 0, 0]])[0]
    with pytest.raises(ValueError, match="infinity"):
        trees.predict([[np.inf, 0, 0]])
    with pytest.raises(ValueError, match="NaN"):
        BaggingClassifier(2).fit(X, y)


@pytest.mark.parametrize("trees", [GradientBoostingClassifier(10), BaggingClassifier(10)])
def test_they_work_with_scikit_learns_tools(trees):
    X, y = load_iris(return_X_y=True)
    assert is_classifier(trees) and clone(trees).get_params() == trees.get_params()
    assert cross_val_score(make_pipeline(StandardScaler(), trees), X, y).mean() > 0.9
    assert GridSearchCV(trees, {"max_depth": [1, 4]}).fit(X, y).best_score_ > 0.9
    random = np.random.default_rng(0)
    X = random.normal(size=(500, 5))
    importance = trees.fit(X, X[:, 3] > 0).feature_importances_
    assert importance.argmax() == 3 and importance.sum() == pytest.approx(1)


def test_bagging_tells_its_out_of_bag_accuracy():
    X, y = load_iris(return_X_y=True)
    assert 0.9 < BaggingClassifier(50, oob_score=True).fit(X, y).oob_score_ <= 1
    assert not hasattr(BaggingClassifier(5).fit(X, y), "oob_score_")


@pytest.mark.parametrize(
    "wrong",
    [
        {"n_estimators": 0},
        {"learning_rate": 2},
        {"learning_rate": 0},
        {"max_leaf_nodes": 1},
        {"subsample": 0.0},
        {"max_bins": 300},
        {"l2_regularization": -1},
        {"n_iter_no_change": 0},
        {"class_weight": {"x": 1}},
    ],
)
def test_parameters_out_of_range_are_refused(wrong):
    X, y = load_iris(return_X_y=True)
    with pytest.raises(ValueError):
        GradientBoostingClassifier(**wrong).fit(X, y)
