"""Module `classification`: scikit-learn's own checks, its accuracy, and the same bytes for any number of threads."""

import pickle

import numpy as np
import pytest
from scansion import BaggingClassifier, RandomForestClassifier
from sklearn import config_context
from sklearn.base import clone, is_classifier
from sklearn.datasets import load_digits, load_iris, load_wine
from sklearn.ensemble import RandomForestClassifier as Peer
from sklearn.exceptions import DataConversionWarning, UnsetMetadataPassedError
from sklearn.model_selection import GridSearchCV, cross_val_score, train_test_split
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import parametrize_with_checks

SAMPLED = "bootstrap samples differ where rows are repeated, as in scikit-learn's own forest"


def expected_failures(estimator):
    """What scikit-learn expects of its own forests too."""
    return {"check_sample_weight_equivalence_on_dense_data": SAMPLED}


@parametrize_with_checks(
    [RandomForestClassifier(n_estimators=10), RandomForestClassifier(n_estimators=10, trainer="ethz")],
    expected_failed_checks=expected_failures,
)
def test_scikit_learn_checks_pass(estimator, check):
    check(estimator)


@pytest.mark.parametrize("load", [load_iris, load_wine, load_digits])
def test_accuracy_is_that_of_scikit_learn(load):
    X, y = load(return_X_y=True)
    ours, theirs = [], []
    for seed in range(10):
        a, b, c, d = train_test_split(X, y, test_size=0.4, random_state=seed, stratify=y)
        ours.append(RandomForestClassifier(random_state=seed).fit(a, c).score(b, d))
        theirs.append(Peer(random_state=seed).fit(a, c).score(b, d))
    assert abs(np.mean(ours) - np.mean(theirs)) < 0.01, (np.mean(ours), np.mean(theirs))


@pytest.mark.parametrize("trainer", ["breiman", "ethz"])
def test_the_same_bytes_for_any_number_of_threads(trainer):
    X, y = load_digits(return_X_y=True)
    made = [RandomForestClassifier(20, trainer=trainer, n_jobs=n).fit(X, y) for n in (1, 2, 3, 8)]
    assert len({forest.predict_proba(X).tobytes() for forest in made}) == 1
    assert len({pickle.dumps(forest._trees) for forest in made}) == 1


def test_random_state_decides_and_none_stands_for_zero():
    X, y = load_iris(return_X_y=True)

    def proba(state):
        return RandomForestClassifier(5, random_state=state).fit(X, y).predict_proba(X).tobytes()

    assert proba(None) == proba(0) != proba(1)
    assert proba(np.random.RandomState(3)) == proba(np.random.RandomState(3))


def test_it_works_with_scikit_learns_tools():
    X, y = load_iris(return_X_y=True)
    forest = RandomForestClassifier(10)
    assert is_classifier(forest) and clone(forest).get_params() == forest.get_params()
    assert cross_val_score(make_pipeline(StandardScaler(), forest), X, y).mean() > 0.9
    search = GridSearchCV(forest, {"max_depth": [1, 4]}).fit(X, y)
    assert search.best_params_ == {"max_depth": 4}


def test_a_pickled_forest_gives_the_same_answers():
    X, y = load_wine(return_X_y=True)
    forest = RandomForestClassifier(10).fit(X, y)
    assert pickle.loads(pickle.dumps(forest)).predict_proba(X).tobytes() == forest.predict_proba(X).tobytes()


def test_importances_find_the_feature_that_decides():
    random = np.random.default_rng(0)
    X = random.normal(size=(500, 5))
    importance = RandomForestClassifier(30).fit(X, X[:, 3] > 0).feature_importances_
    assert importance.argmax() == 3 and importance.sum() == pytest.approx(1)


def test_out_of_bag_accuracy_is_near_that_of_new_data():
    X, y = load_digits(return_X_y=True)
    a, b, c, d = train_test_split(X, y, random_state=0)
    forest = RandomForestClassifier(oob_score=True).fit(a, c)
    assert forest.oob_score_ == pytest.approx(forest.score(b, d), abs=0.04)


def test_labels_may_be_text_and_weights_count():
    X, y = np.array([[0.0], [0.0], [1.0]]), ["low", "high", "high"]
    forest = RandomForestClassifier(20, bootstrap=False).fit(X, y, sample_weight=[1, 3, 1])
    np.testing.assert_allclose(forest.predict_proba([[0.0]]), [[0.75, 0.25]], atol=1e-6)
    assert forest.classes_.tolist() == ["high", "low"]
    dict_weight = RandomForestClassifier(20, bootstrap=False, class_weight={"high": 3}).fit(X, y)
    np.testing.assert_allclose(dict_weight.predict_proba([[0.0]]), [[0.75, 0.25]], atol=1e-6)


def test_what_cannot_be_learned_from_is_refused_by_name():
    X, y = load_iris(return_X_y=True)
    holes = X.copy()
    holes[3, 1] = np.nan
    with pytest.raises(ValueError, match="Input X contains NaN"):
        RandomForestClassifier().fit(holes, y)
    for name, value in [
        ("n_estimators", 0),
        ("max_depth", -1),
        ("max_bins", 256),
        ("max_bins", 1),
        ("min_samples_split", 1),
        ("min_samples_leaf", 0),
        ("min_weight_fraction_leaf", 0.7),
        ("criterion", "mse"),
        ("max_features", 0),
        ("max_features", 1.5),
        ("trainer", "cgal"),
        ("class_weight", {9: 1.0}),
        ("class_weight", "heavy"),
        ("random_state", -1),
        ("n_jobs", 0),
    ]:
        with pytest.raises(ValueError, match=name):
            RandomForestClassifier(**{name: value}).fit(X, y)


@pytest.mark.parametrize("kind", [RandomForestClassifier, BaggingClassifier])
def test_permutation_importance_agrees_with_scikit_learn(kind):
    inspection = pytest.importorskip("sklearn.inspection")
    random = np.random.default_rng(0)
    X = random.random((1500, 4)).astype(np.float32)
    y = np.where(X[:, 2] + 0.3 * X[:, 0] > 0.6, "high", "low")
    forest = kind(n_estimators=30, random_state=0).fit(X[:1000], y[:1000])
    ours = forest.permutation_importance(X[1000:], y[1000:], n_repeats=20)
    theirs = inspection.permutation_importance(forest, X[1000:], y[1000:], n_repeats=20, random_state=0)
    np.testing.assert_allclose(ours.importances_mean, theirs.importances_mean, atol=0.02)
    np.testing.assert_allclose(ours.importances_std, theirs.importances_std, atol=0.01)
    with pytest.raises(ValueError, match="no class"):
        forest.permutation_importance(X, np.full(1500, "other"))


def test_scores_compare_each_row_with_its_own_label():
    X, y = load_iris(return_X_y=True)
    forest = RandomForestClassifier(10).fit(X[:100], y[:100])
    accuracy = np.mean(forest.predict(X) == y)
    assert forest.score(X, y) == pytest.approx(accuracy) and accuracy < 0.7
    with pytest.warns(DataConversionWarning):
        assert forest.score(X, y[:, None]) == pytest.approx(accuracy)
    for wrong in ([1], y[:-1], None, y[None]):
        with pytest.raises(ValueError, match="y|samples"):
            forest.score(X, wrong)


def test_labels_that_are_missing_or_of_another_kind_are_refused():
    X = np.arange(8.0).reshape(4, 2)
    for missing in (None, np.nan, np.float32("nan")):
        y = np.array([0, 1, missing, 1], dtype=object)
        with pytest.raises(ValueError, match="Input y contains NaN"):
            RandomForestClassifier(2).fit(X, y)
    numbers, text = RandomForestClassifier(2).fit(X, [0, 1, 0, 1]), RandomForestClassifier(2).fit(X, list("abab"))
    with pytest.raises(ValueError, match="y: found text, expected numbers"):
        numbers.score(X, list("abab"))
    with pytest.raises(ValueError, match="y: found numbers, expected text"):
        text.score(X, [0, 1, 0, 1])
    assert text.score(X, np.array(list("abab"), dtype=object)) == text.score(X, list("abab"))


def test_bytes_are_text_in_scores():
    X, text = np.arange(8.0).reshape(4, 2), np.array(list("aabb"))
    kinds = [text, text.astype("S"), text.astype(object), text.astype("S").astype(object)]
    for learned in kinds:
        forest = RandomForestClassifier(5, bootstrap=False).fit(X, learned)
        for given in kinds:
            assert forest.score(X, given) == 1 and forest.score(X, given[[0, 2, 2, 3]]) == 0.75
            assert forest.score(X, given[[0, 2, 2, 3]], sample_weight=[1, 2, 1, 1]) == 0.6


def test_scores_with_the_largest_and_smallest_weights_are_shares():
    X, y = np.arange(8.0).reshape(4, 2), [0, 0, 1, 1]
    forest = RandomForestClassifier(5, bootstrap=False).fit(X, y)
    for scale in (1e308, 4e307, 1.0, 1e-320, 5e-324):
        assert forest.score(X, [1, 0, 1, 1], sample_weight=np.full(4, scale)) == 0.75
        assert forest.score(X, [1, 0, 1, 1], sample_weight=scale) == 0.75
    assert forest.score(X, [1, 0, 1, 1], sample_weight=[1e308, 1e308, 0, 1]) == 0.5


def test_weights_go_through_scikit_learns_metadata_routing():
    random = np.random.default_rng(0)
    X, y = random.random((200, 3)), random.integers(0, 2, 200)
    weights = np.where(y == 1, 5.0, 0.01)
    forest = RandomForestClassifier(5)
    with pytest.raises(RuntimeError, match="enable_metadata_routing"):
        forest.set_fit_request(sample_weight=True)
    with config_context(enable_metadata_routing=True):
        search = GridSearchCV(RandomForestClassifier(5), {"max_depth": [2]}, cv=2)
        with pytest.raises(UnsetMetadataPassedError, match="sample_weight"):
            search.fit(X, y, sample_weight=weights)
        asked = clone(forest.set_fit_request(sample_weight=True).set_score_request(sample_weight=False))
        search = GridSearchCV(asked, {"max_depth": [2]}, cv=2).fit(X, y, sample_weight=weights)
        expected = RandomForestClassifier(5, max_depth=2).fit(X, y, sample_weight=weights).predict_proba(X)
        assert search.best_estimator_.predict_proba(X).tobytes() == expected.tobytes()
        asked.set_score_request(sample_weight=True)
        weighted = GridSearchCV(asked, {"max_depth": [2]}, cv=2).fit(X, y, sample_weight=weights)
        # All but a few are taken for the heavy class, which is half of the rows.
        assert search.best_score_ < 0.7 and weighted.best_score_ > 0.95


def test_a_request_without_an_argument_changes_nothing():
    with config_context(enable_metadata_routing=True):
        forest = RandomForestClassifier().set_fit_request(sample_weight=True).set_fit_request()
        assert forest.get_metadata_routing().fit.requests == {"sample_weight": True}
