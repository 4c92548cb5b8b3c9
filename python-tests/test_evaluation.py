"""Module `evaluation`: agreement with scikit-learn's metrics."""

import numpy as np
import pytest
from scansion import evaluation, segment_colours, segmentation
from sklearn import metrics

RANDOM = np.random.default_rng(0)
TRUTH = RANDOM.choice([2, 5, 6, 9], 2000, p=[0.6, 0.2, 0.15, 0.05]).astype(np.uint8)
PREDICTED = np.where(RANDOM.random(2000) < 0.7, TRUTH, RANDOM.choice([2, 5, 6], 2000)).astype(np.uint8)


def test_the_confusion_matrix_has_truth_as_rows():
    counts, codes = evaluation.confusion_matrix(TRUTH, PREDICTED)
    assert codes.tolist() == [2, 5, 6, 9]
    np.testing.assert_array_equal(counts, metrics.confusion_matrix(TRUTH, PREDICTED))
    lopsided, codes = evaluation.confusion_matrix([2, 2, 2], [2, 6, 6])
    assert lopsided[0, codes.tolist().index(6)] == 2


def test_scores_agree_with_scikit_learn():
    found = evaluation.scores(TRUTH, PREDICTED)
    codes = [2, 5, 6, 9]
    precision, recall, f1, support = metrics.precision_recall_fscore_support(
        TRUTH, PREDICTED, labels=codes, zero_division=0
    )
    iou = metrics.jaccard_score(TRUTH, PREDICTED, labels=codes, average=None, zero_division=0)
    for i, label in enumerate(found["labels"]):
        assert label["code"] == codes[i]
        assert label["precision"] == pytest.approx(precision[i])
        assert label["recall"] == pytest.approx(recall[i])
        assert label["f1_score"] == pytest.approx(f1[i])
        assert label["intersection_over_union"] == pytest.approx(iou[i])
        assert label["support"] == support[i]
    assert found["overall_accuracy"] == pytest.approx(metrics.accuracy_score(TRUTH, PREDICTED))
    assert found["kappa"] == pytest.approx(metrics.cohen_kappa_score(TRUTH, PREDICTED))
    assert found["mean_f1_score"] == pytest.approx(f1.mean())
    assert found["mean_intersection_over_union"] == pytest.approx(iou.mean())
    np.testing.assert_array_equal(found["confusion_matrix"], metrics.confusion_matrix(TRUTH, PREDICTED))


def test_unlabelled_points_are_skipped():
    truth = TRUTH.copy()
    truth[:100] = 1
    all_but = evaluation.scores(TRUTH[100:], PREDICTED[100:])
    assert evaluation.scores(truth, PREDICTED, unlabelled=[0, 1])["labels"] == all_but["labels"]


def test_the_report_names_classes():
    text = evaluation.report(TRUTH, PREDICTED)
    assert "ground" in text and "building" in text


def test_arrays_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="predicted"):
        evaluation.scores(TRUTH, PREDICTED[1:])
    with pytest.raises(ValueError, match="256"):
        evaluation.scores([2, 256], [2, 2])
    with pytest.raises(TypeError):
        evaluation.scores(["a"], [1])


def test_negative_truth_is_skipped_and_negative_predictions_are_errors():
    truth, predicted = np.array([0, 0, 1, -1, 1]), np.array([0, -1, 1, 0, 0])
    counts, codes = evaluation.confusion_matrix(truth, predicted)
    kept = truth >= 0
    expected = metrics.confusion_matrix(truth[kept], np.where(predicted < 0, 255, predicted)[kept])
    assert codes.tolist() == [0, 1, 255]
    np.testing.assert_array_equal(counts, expected)
    assert evaluation.scores(truth.astype(float), predicted)["overall_accuracy"] == pytest.approx(0.5)


def test_text_is_compared_as_scikit_learn_does():
    names = np.array(["", "", "ground", "", "", "bush", "wall", "", "", "wire"])
    truth, predicted = names[TRUTH], names[PREDICTED]
    counts, found = evaluation.confusion_matrix(truth, predicted)
    order = sorted(set(truth))
    assert found.tolist() == order
    np.testing.assert_array_equal(counts, metrics.confusion_matrix(truth, predicted, labels=order))
    scores = evaluation.scores(truth, predicted)
    assert scores["overall_accuracy"] == pytest.approx(metrics.accuracy_score(truth, predicted))
    assert [label["name"] for label in scores["labels"]] == order
    assert "wire" in evaluation.report(truth, predicted)
    kept = truth != "wire"
    some = evaluation.scores(truth, predicted, unlabelled=["wire"])
    assert some["overall_accuracy"] == pytest.approx(metrics.accuracy_score(truth[kept], predicted[kept]))


def test_what_is_unlabelled_is_text_if_the_labels_are():
    for wrong in ([0], ["a", 0], [0.5], np.array([0, 1])):
        for call in (
            lambda wrong=wrong: evaluation.scores(["0", "a", "a"], ["a", "a", "a"], unlabelled=wrong),
            lambda wrong=wrong: evaluation.purities([1, 1, 2], ["0", "a", "a"], unlabelled=wrong),
        ):
            with pytest.raises(TypeError, match="unlabelled: expected text or None, found .* at index"):
                call()
    with pytest.raises(TypeError, match="unlabelled: found 'wire', expected a list"):
        evaluation.scores(["wire"], ["wire"], unlabelled="wire")
    with pytest.raises(TypeError, match="unlabelled"):
        evaluation.scores([0, 1], [0, 1], unlabelled=["a"])
    for right in (["0"], [b"0"], np.array(["0"]), [None, "0"], (text for text in "0")):
        assert evaluation.scores(["0", "a", "a"], ["a", "a", "a"], unlabelled=right)["overall_accuracy"] == 1


def test_none_is_no_label_among_numbers_too():
    truth, predicted = [2, None, 6, 6, 300], [2, 2, None, 6, 5]
    same = [2, -1, 6, 6, 300], [2, 2, -1, 6, 5]
    maps = {"map_truth": "300=5"}
    assert evaluation.scores(truth, predicted, **maps) == evaluation.scores(*same, **maps)
    assert evaluation.scores(truth, predicted, **maps)["overall_accuracy"] == 0.75
    assert evaluation.purities([1, 1, 1], [2, None, 6]).tolist() == [0.5]
    assert evaluation.confusion_matrix([None, None], [2, 2])[0].shape == (0, 0)
    with pytest.raises(TypeError, match="truth"):
        evaluation.scores([2, {}], [2, 2])


def test_rows_of_classes_have_their_names():
    text, none = ["wall", "bush", "wall"], ["wall", None, "bush"]
    for pair in ((text, none), ([2, 6, 0], [2, -1, 6])):
        rows, labels = evaluation.one_vs_rest(*pair), evaluation.scores(*pair)["labels"]
        assert [(row["code"], row["name"]) for row in rows] == [(label["code"], label["name"]) for label in labels]
    assert evaluation.one_vs_rest([], []) == []
    xyz = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0), [0.0]), -1).reshape(-1, 3)
    truth = np.where(xyz[:, 0] < 5, "wall", "bush")
    classes = evaluation.segmentation_error(xyz, xyz[:, 0] < 5, truth, cell=1.0)["classes"]
    assert [(row["code"], row["name"]) for row in classes] == [(0, "bush"), (1, "wall")]
    by_code = evaluation.segmentation_error(xyz, xyz[:, 0] < 5, np.where(xyz[:, 0] < 5, 6, 2), cell=1.0)["classes"]
    assert [row["name"] for row in by_code] == ["ground", "building"]


def test_what_has_nothing_to_compare_has_an_error_of_nan(monkeypatch):
    text = '{"classes": [{"code": 2, "error": 0.5, "precision": null}], "error": null, "precision": null}'
    monkeypatch.setattr(evaluation._core, "segmentation_error", lambda *_: text)
    found = evaluation.segmentation_error(np.eye(3), [0, 0, 1], [-1, 2, -1])
    assert np.isnan([found["error"], found["precision"], found["classes"][0]["precision"]]).all()


def test_nothing_to_score_is_an_error_and_one_class_has_no_kappa():
    for truth, predicted, cause in ([[None, None], [2, 2], "all 2 points"], [[], [], "there is none"]):
        for call in (evaluation.scores, evaluation.report):
            with pytest.raises(ValueError, match=f"no point to score: {cause}"):
                call(truth, predicted)
    found = evaluation.scores([2, 2], [2, 2])
    assert np.isnan(found["kappa"]) and found["overall_accuracy"] == 1
    assert "kappa -" in evaluation.report([2, 2], [2, 2])
    none = evaluation.boundary_scores([[0, 1]], [0, 0], [2, 2])
    assert np.isnan([none["recall"], none["precision"]]).all()


def test_each_side_has_a_map_of_its_own():
    truth = np.select([TRUTH == 2, TRUTH == 5, TRUTH == 6], [0, 1, 2], 3)
    expected = metrics.accuracy_score(TRUTH, PREDICTED)
    found = evaluation.scores(truth, PREDICTED, map_truth="0=2,1=5,2=6,3=9")
    assert found["overall_accuracy"] == pytest.approx(expected)
    found = evaluation.scores(truth, PREDICTED, map_predicted="2=0,5=1,6=2,9=3")
    assert found["overall_accuracy"] == pytest.approx(expected)
    with pytest.raises(ValueError, match="map"):
        evaluation.scores(truth, PREDICTED, map_truth="car=2")
    with pytest.raises(ValueError, match="map_truth"):
        evaluation.scores(["a"], ["a"], map_truth="1=2")


@pytest.mark.parametrize("wrong", [2**32 + 1, -2, 0.2, np.nan, np.inf, 2**64 - 1])
def test_numbers_of_segments_are_not_cut(wrong):
    labels, truth, xyz = np.array([1, wrong]), [2, 6], np.eye(2, 3)
    calls = {
        "segmentation_error": lambda: evaluation.segmentation_error(xyz, labels, truth),
        "purities": lambda: evaluation.purities(labels, truth),
        "boundary_scores": lambda: evaluation.boundary_scores([[0, 1]], labels, truth),
        "segment_shapes": lambda: segmentation.segment_shapes(xyz, labels),
        "segment_graph": lambda: segmentation.segment_graph([[0, 1]], labels),
        "object_features": lambda: segmentation.object_features(xyz, labels),
        "segment_colours": lambda: segment_colours(labels),
    }
    for call in calls.values():
        with pytest.raises(ValueError, match=r"expected whole numbers in -1\.\.4294967295, found .* at index 1"):
            call()


def test_whole_floats_and_the_largest_number_are_segments():
    for labels in ([1.0, 4294967295.0], np.array([1, 2**32 - 1], dtype=np.uint64), [True, False]):
        assert evaluation.purities(labels, [2, 6]).tolist() == [1, 1]


def test_points_of_no_segment_are_left_out():
    """Points of -1, as of `supervoxels`: the result is that of the other points alone."""
    random = np.random.default_rng(5)
    xyz, truth, labels = random.uniform(0, 9, (300, 3)), random.integers(0, 3, 300), random.integers(-1, 6, 300)
    colours, heights = random.uniform(0, 1, (300, 3)), random.uniform(0, 9, 300)
    edges, weights = random.permutation(300)[:200].reshape(-1, 2), random.uniform(0, 1, 100)
    kept = labels >= 0
    inside = kept[edges].all(1)
    between = (np.cumsum(kept) - 1)[edges[inside]]
    assert 0 < kept.sum() < 300 and 0 < inside.sum() < 100
    calls = [
        (segmentation.segment_shapes, (xyz, labels), (xyz[kept], labels[kept]), {}),
        (segmentation.segment_graph, (edges, labels, weights), (between, labels[kept], weights[inside]), {"interface": "weight"}),
        (segmentation.segment_graph, (edges, labels), (between, labels[kept]), {}),
        (evaluation.purities, (labels, truth), (labels[kept], truth[kept]), {}),
        (evaluation.boundary_scores, (edges, labels, truth), (between, labels[kept], truth[kept]), {}),
        (evaluation.segmentation_error, (xyz, labels, truth), (xyz[kept], labels[kept], truth[kept]), {"cell": 1.0}),
    ]
    for call, all_points, some, options in calls:
        np.testing.assert_equal(call(*all_points, **options), call(*some, **options))
    rows, names = segmentation.object_features(xyz, labels, colours=colours, heights=heights)
    some = segmentation.object_features(xyz[kept], labels[kept], colours=colours[kept], heights=heights[kept])
    np.testing.assert_array_equal(rows, some[0])
    assert names == some[1]
    assert segment_colours([-1, 0, 4]).tolist() == segment_colours([0, 0, 4]).tolist()
    with pytest.raises(ValueError, match="edge 0-9 does not join two of the 2 nodes"):
        segmentation.segment_graph([[0, 9]], [-1, 1])


def test_no_point_in_a_segment_is_no_segment():
    xyz, none = np.eye(3), [-1, -1, -1]
    assert segmentation.segment_shapes(xyz, none).points.tolist() == []
    assert len(segmentation.object_features(xyz, none)[0]) == 0
    assert len(evaluation.purities(none, [2, 2, 6])) == 0
    assert segmentation.segment_graph([[0, 1]], none)[0].shape == (0, 2)
