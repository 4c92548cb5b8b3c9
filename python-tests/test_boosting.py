"""Module `classification`: boosted and bagged trees against scikit-learn's checks and its own classifiers."""

import pickle

import numpy as np
import pytest
from scansion import BaggingClassifier, GradientBoostingClassifier, RandomForestClassifier
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


@pytest.mark.parametrize("make", [BaggingClassifier, RandomForestClassifier])
@pytest.mark.filterwarnings("ignore:oob_score")
def test_out_of_bag_accuracy_without_samples_to_judge_is_nan(make):
    # One sample is drawn by every tree.
    trees = make(3, oob_score=True).fit([[0.0]], ["only"])
    assert np.isnan(trees.oob_score_)
    assert not hasattr(trees.set_params(oob_score=False).fit([[0.0]], ["only"]), "oob_score_")


@pytest.mark.parametrize("make", [BaggingClassifier, RandomForestClassifier])
def test_samples_that_no_tree_left_out_are_warned_of(make):
    X, y = load_iris(return_X_y=True)
    # A tree leaves out about 37 %: of 150 samples, one tree has judged some and not others.
    with pytest.warns(UserWarning, match="oob_score: .* of 150 samples"):
        one = make(1, oob_score=True).fit(X, y)
    assert 0.7 < one.oob_score_ <= 1


def test_a_count_of_features_is_a_count():
    random = np.random.default_rng(0)
    X = random.normal(size=(400, 6))
    y = X[:, 3] > 0
    used = []
    for wanted in (1, 2, 6, 99, None, 1.0, 0.5, np.int64(1)):
        trees = GradientBoostingClassifier(1, max_features=wanted, max_leaf_nodes=64, min_samples_leaf=1, min_child_weight=0)
        noisy = np.where(random.random(400) < 0.3, ~y, y)
        used.append(np.count_nonzero(trees.fit(X, noisy).feature_importances_))
    assert used == [1, 2, 6, 6, 6, 6, 3, 1]


def test_logarithms_of_probabilities_are_those_of_numpy():
    X, y = load_iris(return_X_y=True)
    for trees in (GradientBoostingClassifier(3), BaggingClassifier(3), RandomForestClassifier(3)):
        probabilities = trees.fit(X, y).predict_proba(X)
        with np.errstate(divide="ignore"):
            np.testing.assert_array_equal(trees.predict_log_proba(X), np.log(probabilities))


def test_weights_that_hold_boosting_back_are_warned_of(recwarn):
    X, y = load_iris(return_X_y=True)
    for total in (1.0, 1e-9):
        with pytest.warns(UserWarning, match="150 samples sum to .*weights of mean 1"):
            GradientBoostingClassifier(2).fit(X, y, sample_weight=np.full(150, total / 150))
    with pytest.warns(UserWarning, match="sum to"):
        GradientBoostingClassifier(2, class_weight={0: 1e-5, 1: 1e-5, 2: 1e-5}).fit(X, y)
    recwarn.clear()
    for weights in (None, np.ones(150), (np.arange(150) % 50 < 3).astype(float), np.full(150, 1e6)):
        GradientBoostingClassifier(2).fit(X, y, sample_weight=weights)
    GradientBoostingClassifier(2, l2_regularization=0).fit(X, y, sample_weight=np.full(150, 1 / 150))
    assert not recwarn.list


def test_weights_of_scores_are_those_of_numpy_and_finite():
    X, y = load_iris(return_X_y=True)
    trees = GradientBoostingClassifier(1, max_leaf_nodes=2).fit(X, y)
    weights = np.random.default_rng(0).random(150)
    expected = weights[trees.predict(X) == y].sum() / weights.sum()
    assert trees.score(X, y, sample_weight=weights) == pytest.approx(expected)
    for wrong, message in [
        (np.where(np.arange(150) == 7, np.nan, 1.0), "sample_weight contains NaN at index 7"),
        (np.where(np.arange(150) == 7, np.inf, 1.0), "sample_weight contains infinity"),
        (np.zeros(150), "non-zero"),
        (-weights, "Negative"),
        (weights[1:], "sample_weight"),
    ]:
        with pytest.raises(ValueError, match=message):
            trees.score(X, y, sample_weight=wrong)


@pytest.mark.parametrize("make", [GradientBoostingClassifier, BaggingClassifier, RandomForestClassifier])
def test_messages_name_what_was_given(make):
    X, y = load_iris(return_X_y=True)
    for wrong in (np.nan, 0, -1, np.inf, "a", 1e60, True):
        with pytest.raises(ValueError, match="class_weight: found .* for the label 2, expected a number above 0"):
            make(class_weight={2: wrong}).fit(X, y)
    with pytest.raises(ValueError, match="n_estimators: found 10001, expected a whole number in 1..10000"):
        make(n_estimators=10_001).fit(X, y)
    X[3, 1] = np.inf
    with pytest.raises(ValueError, match="X contains infinity .* at row 3, column 1"):
        make().fit(X, y)


@pytest.mark.parametrize("name", ["subsample", "max_features", "learning_rate"])
def test_shares_of_nothing_are_refused_by_name(name):
    X, y = load_iris(return_X_y=True)
    for wrong in (0, 0.0, -0.5, 1.5, "a", np.nan):
        with pytest.raises(ValueError, match=f"^{name}: found"):
            GradientBoostingClassifier(**{name: wrong}).fit(X, y)


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
        {"l2_regularization": np.inf},
        {"n_iter_no_change": 0},
        {"class_weight": {"x": 1}},
    ],
)
def test_parameters_out_of_range_are_refused(wrong):
    X, y = load_iris(return_X_y=True)
    with pytest.raises(ValueError):
        GradientBoostingClassifier(**wrong).fit(X, y)
