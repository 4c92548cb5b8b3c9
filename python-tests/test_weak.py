"""Weakly supervised classification, segments and regularisation."""

import pickle

import numpy as np
import pytest
import scansion
from conftest import street
from scansion import WeakClassifier


def few(labels, per_class=15, seed=0):
    random = np.random.default_rng(seed)
    picked = np.full(len(labels), -1)
    for code in np.unique(labels):
        chosen = random.choice(np.flatnonzero(labels == code), per_class, replace=False)
        picked[chosen] = code
    return picked


@pytest.fixture(scope="module")
def fitted():
    xyz, labels = street(0)
    return WeakClassifier(random_state=0).fit(xyz, few(labels))


def test_a_few_labels_name_the_street(fitted):
    xyz, labels = street(0)
    assert (fitted.predict(xyz) == labels).mean() > 0.9
    assert fitted.classes_.tolist() == [2, 5, 6]
    assert fitted.report_["road_examples"] == 15
    alone = fitted.classify(xyz, regularize="none").codes
    assert (fitted.predict(xyz) == labels).mean() >= (alone == labels).mean() - 0.02


def test_the_model_is_a_file_that_the_command_takes_and_knows_its_recipe(fitted, tmp_path):
    fitted.save(tmp_path / "m.model")
    xyz, _ = street(0)
    again = WeakClassifier.load(tmp_path / "m.model")
    assert (again.predict(xyz) == fitted.predict(xyz)).all()
    assert 'recipe = "weak"' in again.recipe_


def test_segments_keep_to_the_labels_in_them():
    xyz, labels = street(0)
    picked = few(labels)
    known = picked >= 0
    # So strong a partition makes few segments; labels cut them.
    right = {}
    for hold in (True, False):
        model = WeakClassifier(
            {"labels.hold": hold, "labels.fit_partition": False, "regularise.partition.intent.strength": 10.0},
            random_state=0,
        ).fit(xyz, picked)
        # Labelled positions are learned: they stand beside the recipe, not in it.
        assert (b"labels = []" in pickle.dumps(model)) != hold and "positions" not in model.recipe_
        found = model.predict(xyz)
        right[hold] = (found[known] == picked[known]).mean(), (found == labels).mean()
    assert right[True][0] > right[False][0] + 0.1 and right[True][1] > right[False][1] + 0.1


def test_the_strength_is_chosen_by_held_out_labels():
    xyz, labels = street(0)
    found = WeakClassifier(strengths=[0.1, 1.0], random_state=1).fit(xyz, few(labels)).report_
    assert [s["strength"] for s in found["strengths"]] == [0.1, 1.0]
    assert found["strength"] in (0.1, 1.0)
    with pytest.raises(TypeError, match="strengths: found a list_iterator, which can be read only once"):
        WeakClassifier(strengths=iter([0.1, 1.0])).fit(xyz, few(labels))


def test_any_model_takes_a_way_to_agree():
    xyz, _ = street(0)
    model = scansion.PointClassifier.default()
    for way in ("none", "local", "point-crf", "consensus", "segment-crf"):
        found = model.classify(xyz, probabilities=True, regularize=way)
        np.testing.assert_allclose(found.probabilities.sum(axis=1), 1, atol=1e-4)
    with pytest.raises(ValueError, match="regularize"):
        model.classify(xyz, regularize="strong")


def test_segments_and_suggestions(labelled):
    found = scansion.segment(labelled, segments_per_hectare=300)
    assert found.cluster_id.min() == 1 and found.report["segments"] == found.cluster_id.max()
    assert 0 < found.report["oracle_accuracy"] <= 1 and len(found.report["trials"]) >= 1
    asked = scansion.suggest(labelled.xyz, 5)
    assert len(asked.segments) <= 5
    scores = [s["points"] for s in asked.segments]
    assert all((asked.cluster_id == s["cluster_id"]).sum() == s["points"] for s in asked.segments), scores
    with pytest.raises(ValueError, match="at most one"):
        scansion.segment(labelled, strength=1.0, smallest_object=0.5)
    with pytest.raises(ValueError, match="uncertaint"):
        scansion.suggest(labelled.xyz, 5, uncertainty=[0.5])


def test_a_second_round_takes_labels_and_model_of_the_first(labelled, tmp_path):
    first = scansion.suggest(labelled.xyz, 6)
    labels = np.full(len(labelled), -1)
    for segment in first.segments:
        own = first.cluster_id == segment["cluster_id"]
        labels[own] = np.bincount(labelled["Classification"][own]).argmax()
    model = WeakClassifier(random_state=0).fit(labelled.xyz, labels)
    model.save(tmp_path / "a.model")
    second = scansion.suggest(labelled.xyz, 3, model=tmp_path / "a.model", labels=labels, page=tmp_path / "page.html")
    asked = {segment["cluster_id"] for segment in first.segments}
    assert second.segments and all(s["cluster_id"] not in asked and s["uncertainty"] < 1 for s in second.segments)
    assert '[2,"class 2"]' in (tmp_path / "page.html").read_text()
    own = scansion.suggest(labelled.xyz, 3, model=model, labels=labels).segments
    assert own == second.segments
    for wrong in ({"labels": labels, "labelled": True}, {"model": model, "uncertainty": np.ones(len(labels))}):
        with pytest.raises(ValueError, match="expected one of them"):
            scansion.suggest(labelled.xyz, 3, **wrong)


def test_suggestions_are_drawn_on_a_page(labelled, tmp_path):
    page = tmp_path / "page.html"
    asked = scansion.suggest(labelled.xyz, 3, page=page, offer={9: "water, deep"})
    assert '[[9,"water  deep"]]' in page.read_text()
    assert page.read_text().count("data:image/png;base64,") == 2 * len(asked.segments) > 0
    with pytest.raises(OSError, match="absent"):
        scansion.suggest(labelled.xyz, 3, page=tmp_path / "absent" / "page.html")


def test_a_grid_of_ground_heights_takes_the_place_of_the_road(tmp_path):
    xyz, labels = street(0)
    grid = tmp_path / "dtm.asc"
    low = xyz.min(0) - 1
    grid.write_text(f"ncols 1\nnrows 1\nxllcorner {low[0]}\nyllcorner {low[1]}\ncellsize 500\n{low[2] - 50}\n")
    # With multi-scale features the forest does not need heights above the road here.
    model = WeakClassifier(recipe={"descriptors": "paper"}, random_state=0).fit(xyz, few(labels))
    with_grid = model.classify(xyz, elevation_model=grid).confidence
    assert (with_grid != model.classify(xyz).confidence).any()
    other = WeakClassifier(random_state=0).fit(xyz, few(labels), elevation_model=grid)
    assert (other.classify(xyz, elevation_model=grid).codes == labels).mean() > 0.9
    with pytest.raises(ValueError, match="elevation model"):
        scansion.PointClassifier.default().classify(xyz, elevation_model=grid)


def test_bad_labels_are_refused():
    xyz, labels = street(0)
    with pytest.raises(ValueError, match="no labelled point"):
        WeakClassifier().fit(xyz, np.full(len(xyz), -1))
    with pytest.raises(ValueError, match="strength"):
        WeakClassifier({"regularise.strength": -1}).fit(xyz, few(labels))


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_uncertainties_are_finite(labelled, wrong):
    doubt = np.full(len(labelled), 0.5)
    doubt[3] = wrong
    with pytest.raises(ValueError, match=f"uncertainty: expected finite numbers, found {wrong} at index 3"):
        scansion.suggest(labelled.xyz, 3, uncertainty=doubt)


def test_the_count_of_suggestions_may_be_numpys(labelled):
    assert len(scansion.suggest(labelled, np.int64(2)).segments) == 2


@pytest.mark.parametrize(("name", "value"), [("count", 2.7), ("count", 0), ("offer", [2, 5.5]), ("offer", {300: "hedge"})])
def test_numbers_of_suggestions_are_not_cut(labelled, tmp_path, name, value):
    given = {"count": 2, "page": tmp_path / "page.html", name: value}
    with pytest.raises(ValueError, match=f"^{name}: found .*, expected a whole number"):
        scansion.suggest(labelled, **given)


@pytest.mark.parametrize("wrong", [300, 2.5])
def test_classes_that_are_no_codes_are_given_as_labels(labelled, wrong):
    codes = np.where(labelled["Classification"] == 6, wrong, -1)
    labelled["Classification"] = codes
    message = rf"Classification: expected codes 0\.\.255 \(.*given as labels\), found {wrong} at index "
    with pytest.raises(ValueError, match=message):
        scansion.suggest(labelled, 3, labelled=True)
    found = scansion.suggest(labelled, 3, labels=np.where(codes == wrong, 6, -1))
    labelled["Classification"] = np.where(codes == wrong, 6, -1)
    assert scansion.suggest(labelled, 3, labelled=True).segments == found.segments
