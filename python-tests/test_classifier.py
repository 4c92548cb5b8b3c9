"""Module `recipes`: training on labelled clouds, and classification."""

import copy
import json
import pickle
import subprocess
import sys
import warnings

import laspy
import numpy as np
import pytest
import scansion
from conftest import street
from scansion import ObjectClassifier, PointClassifier, WeakClassifier
from sklearn import metrics

RECIPE = {"features.pyramid.first_scale": 0.4, "features.pyramid.levels": 5, "forest.trees": 20}
SETTINGS = {
    PointClassifier: RECIPE,
    WeakClassifier: {"forest.trees": 20},
    ObjectClassifier: {"forest.trees": 20, "segments.slic.size": 1.0, "training.share": 1.0},
}


@pytest.fixture(scope="module")
def fitted():
    xyz, labels = street(0)
    return PointClassifier(RECIPE).fit(xyz, labels)


def test_a_new_street_is_named_rightly(fitted):
    xyz, labels = street(1)
    predicted = fitted.predict(xyz)
    assert predicted.dtype == np.uint8 and (predicted == labels).mean() > 0.95
    assert fitted.score(xyz, labels) == pytest.approx((predicted == labels).mean())
    assert fitted.classes_.tolist() == [2, 5, 6] and fitted.class_names_[0] == "class 2"


def test_probabilities_fit_the_codes(fitted):
    xyz, _ = street(1)
    found = fitted.classify(xyz, probabilities=True)
    np.testing.assert_allclose(found.probabilities.sum(axis=1), 1, atol=1e-5)
    np.testing.assert_array_equal(fitted.classes_[found.probabilities.argmax(axis=1)], found.codes)
    np.testing.assert_allclose(found.probabilities.max(axis=1), found.confidence, atol=1e-6)
    p = found.probabilities.astype(float)
    entropy = -(p * np.log(np.where(p > 0, p, 1))).sum(axis=1)
    np.testing.assert_allclose(found.entropy, entropy, atol=1e-4)
    assert (fitted.predict_proba(xyz) == found.probabilities).all()


def test_labels_come_from_columns_or_arrays_and_from_several_clouds(labelled):
    by_column = PointClassifier(RECIPE).fit(labelled)
    by_array = PointClassifier(RECIPE).fit([labelled.xyz], [labelled["Classification"]])
    assert by_column.predict(labelled).tobytes() == by_array.predict(labelled).tobytes()
    two = PointClassifier(RECIPE).fit([labelled, street(3)[0]], [labelled["Classification"], street(3)[1]])
    assert two.report_["classes"][0]["points"] == 2 * by_column.report_["classes"][0]["points"]
    with pytest.raises(ValueError, match="labels"):
        PointClassifier(RECIPE).fit([labelled, labelled], [labelled["Classification"]])


def test_unlabelled_points_are_not_learned_from(labelled):
    labels = labelled["Classification"].astype(np.int16)
    labels[::2] = -1
    labels[1::8] = 1
    report = PointClassifier(RECIPE, unlabelled=[0, 1]).fit(labelled.xyz, labels).report_
    assert [c["code"] for c in report["classes"]] == [2, 5, 6]
    assert report["unlabelled"] == (labels < 2).sum()
    every = PointClassifier(RECIPE).fit(labelled.xyz, labels).report_
    assert [c["code"] for c in every["classes"]] == [1, 2, 5, 6]
    assert every["unlabelled"] == (labels < 0).sum()
    with pytest.raises(ValueError, match="label"):
        PointClassifier(RECIPE).fit(labelled.xyz, np.full(len(labelled), -1))
    none = [None if code < 0 else code for code in labels.tolist()]
    by_none = PointClassifier(RECIPE).fit(labelled.xyz, none)
    assert by_none.report_["classes"] == every["classes"] and by_none.report_["unlabelled"] == every["unlabelled"]
    assert by_none.score(labelled.xyz, none) == by_none.score(labelled.xyz, labels)


@pytest.mark.parametrize("kind", [PointClassifier, WeakClassifier, ObjectClassifier])
def test_codes_from_0_are_all_learned_and_scored(kind):
    xyz, labels = street(0)
    other, truth = street(1)
    small = {2: 0, 5: 1, 6: 2}
    codes, true = (np.vectorize(small.get)(y).astype(np.int64) for y in (labels, truth))
    classifier = kind(SETTINGS[kind], random_state=0).fit(xyz, codes)
    assert classifier.classes_.tolist() == [0, 1, 2] and classifier.report_["unlabelled"] == 0
    predicted = classifier.predict(other)
    assert classifier.score(other, true) == pytest.approx(metrics.accuracy_score(true, predicted))
    # Half the truth is wrong on purpose: a score that leaves out points of code 0 or 1 would not see it.
    wrong = np.where(np.arange(len(true)) % 2 == 0, true, 2 - true)
    assert classifier.score(other, wrong) == pytest.approx(metrics.accuracy_score(wrong, predicted))
    partly = wrong.copy()
    partly[::3] = -1
    kept = partly >= 0
    assert classifier.score(other, partly) == pytest.approx(metrics.accuracy_score(wrong[kept], predicted[kept]))
    with pytest.raises(ValueError, match="no label"):
        classifier.score(other, np.full(len(other), -1))


@pytest.mark.parametrize("kind", [PointClassifier, WeakClassifier, ObjectClassifier])
def test_text_comes_back_as_text(kind, tmp_path):
    xyz, labels = street(0)
    other, truth = street(1)
    names = {2: "ground", 5: "bush", 6: "wall"}
    text, true = (np.array([names[c] for c in y.tolist()]) for y in (labels, truth))
    by_text = kind(SETTINGS[kind], random_state=0).fit(xyz, text)
    assert by_text.classes_.tolist() == ["bush", "ground", "wall"] == by_text.class_names_
    predicted = by_text.predict(other)
    assert predicted.dtype.kind == "U"
    assert (predicted == true).mean() > 0.8
    assert by_text.score(other, true) == pytest.approx(metrics.accuracy_score(true, predicted))
    with pytest.raises(ValueError, match="labels: found numbers, expected text"):
        by_text.score(other, truth)
    by_text.save(tmp_path / "a.model")
    loaded = kind.load(tmp_path / "a.model")
    for again in (pickle.loads(pickle.dumps(by_text)), loaded, pickle.loads(pickle.dumps(loaded))):
        assert (again.predict(other) == predicted).all() and again.classes_.tolist() == by_text.class_names_
    loaded.save(tmp_path / "b.model")
    files = [(tmp_path / name).read_bytes() for name in ("a.model", "b.model")]
    assert files[0] == files[1] and len(list(tmp_path.iterdir())) == 2
    partly = text.astype(object)
    partly[::2] = None
    partly[1::10] = "unknown"
    half = kind(SETTINGS[kind], unlabelled=["unknown"], random_state=0).fit(xyz, partly)
    half.save(tmp_path / "half.model")
    again = kind.load(tmp_path / "half.model")
    assert again.unlabelled == ["unknown"] and again.score(xyz, partly) == half.score(xyz, partly)
    assert half.classes_.tolist() == ["bush", "ground", "wall"]
    assert half.report_["unlabelled"] == (partly == None).sum() + (partly == "unknown").sum()  # noqa: E711
    with pytest.raises(ValueError, match="class_map"):
        kind(class_map="1=2").fit(xyz, text)
    for wrong in ([0], "unknown"):
        with pytest.raises(TypeError, match="unlabelled"):
            kind(SETTINGS[kind], unlabelled=wrong).fit(xyz, text)
    once = kind(SETTINGS[kind], unlabelled=(label for label in ["unknown"]), random_state=0)
    with pytest.raises(TypeError, match="unlabelled: found a generator, which can be read only once, expected a list"):
        once.fit(xyz, partly)
    assert once.get_params()["unlabelled"] is once.unlabelled and list(once.unlabelled) == ["unknown"]
    by_text.unlabelled = [0]
    with pytest.raises(TypeError, match="unlabelled: expected text or None, found 0"):
        by_text.score(other, true)
    by_text.unlabelled = map(str, [0])
    for use in (lambda: by_text.score(other, true), lambda: by_text.save(tmp_path / "once.model")):
        with pytest.raises(TypeError, match="unlabelled: found a map"):
            use()


def test_rare_classes_are_warned_of():
    xyz, labels = street(0)
    labels = labels.copy()
    labels[:3] = 9
    with pytest.warns(UserWarning, match="class 9.*left out"):
        fitted = PointClassifier(RECIPE).fit(xyz, labels)
    assert fitted.classes_.tolist() == [2, 5, 6]
    assert [c["samples"] > 0 for c in fitted.report_["classes"]] == [True, True, True, False]
    assert any("left out" in note for note in fitted.report_["warnings"])
    with pytest.warns(UserWarning, match="weighs"):
        kept = PointClassifier({**RECIPE, "training.rare": "keep"}).fit(xyz, labels)
    assert kept.classes_.tolist() == [2, 5, 6, 9]


def test_warnings_and_reports_name_labels_that_are_text():
    xyz, labels = street(0)
    names = np.array(["", "", "ground", "", "", "bush", "wall"], dtype=object)[labels]
    names[:3] = "rare thing"
    with pytest.warns(UserWarning, match="rare thing.*left out"):
        fitted = PointClassifier(RECIPE).fit(xyz, names)
    counts = {row["name"]: row["points"] for row in fitted.report_["classes"]}
    assert counts == {name: (names == name).sum() for name in ("bush", "ground", "rare thing", "wall")}


def test_recipes_without_weights_refuse_those_of_points(labelled):
    weights = np.ones(len(labelled))
    for model in (WeakClassifier(), ObjectClassifier(), PointClassifier("weak"), PointClassifier({"recipe": "objects"})):
        with pytest.raises(ValueError, match="sample_weight: found weights, expected None"):
            model.fit(labelled, sample_weight=weights)
    with pytest.raises(ValueError, match="treees"):
        PointClassifier({"forest.treees": 7}).fit(labelled, sample_weight=weights)


def test_logarithms_of_probabilities_are_those_of_numpy(fitted):
    xyz, _ = street(1)
    with np.errstate(divide="ignore"):
        expected = np.log(fitted.predict_proba(xyz))
    np.testing.assert_array_equal(fitted.predict_log_proba(xyz), expected)


def test_one_class_is_refused(labelled):
    for kind in (PointClassifier, WeakClassifier, ObjectClassifier):
        with pytest.raises(ValueError, match="only one class"):
            kind().fit(labelled.xyz, np.full(len(labelled), 2))


def test_the_list_of_codes_of_a_cloud_tells_what_is_unlabelled(labelled, tmp_path):
    codes = np.asarray(labelled["Classification"]).copy()
    codes[::4], codes[1::4] = 0, 1
    labelled["Classification"] = codes
    assert labelled.scheme == "own"
    assert PointClassifier(RECIPE).fit(labelled).classes_.tolist() == [0, 1, 2, 5, 6]
    scansion.write(tmp_path / "a.laz", labelled)
    scan = scansion.read(tmp_path / "a.laz")
    assert scan.scheme == "asprs" and pickle.loads(pickle.dumps(scan)).scheme == "asprs"
    assert scansion.PointCloud.from_laspy(laspy.read(tmp_path / "a.laz")).scheme == "asprs"
    fitted = PointClassifier(RECIPE).fit(scan)
    assert fitted.classes_.tolist() == [2, 5, 6] and fitted.class_names_[0] == "ground"
    known = codes > 1
    predicted = fitted.predict(scan)
    assert fitted.score(scan) == pytest.approx((predicted == codes)[known].mean())
    mapped = PointClassifier(RECIPE, class_map="5=6").fit(scan)
    true = np.where(codes == 5, 6, codes)
    assert mapped.score(scan) == pytest.approx((mapped.predict(scan) == true)[known].mean())
    labelled.scheme = "semantic3d"
    assert PointClassifier(RECIPE).fit(labelled).class_names_[0] == "man-made terrain"
    with pytest.raises(ValueError, match="semantic3d"):
        labelled.scheme = "las"


def test_the_class_map_changes_what_is_learned(labelled):
    assert PointClassifier(RECIPE, class_map="5=6").fit(labelled).classes_.tolist() == [2, 6]


def test_codes_above_255_are_mapped_in_fit_and_score():
    xyz, labels = street(0)
    large = labels.astype(np.uint16) * 100
    model = PointClassifier(RECIPE, class_map="200=2,500=5,600=6").fit(xyz, large)
    assert model.codes_.tolist() == [2, 5, 6]
    assert model.score(xyz, large) == pytest.approx((model.predict(xyz) == labels).mean())
    with pytest.raises(ValueError, match="map"):
        PointClassifier(RECIPE, class_map="200=2").fit(xyz, large)
    with pytest.raises(ValueError, match="found 600"):
        model.set_params(class_map="200=2,500=5").score(xyz, large)


def test_a_model_survives_files_and_pickle(fitted, tmp_path):
    xyz, _ = street(1)
    fitted.save(tmp_path / "a.model")
    expected = fitted.predict_proba(xyz).tobytes()
    for again in (PointClassifier.load(tmp_path / "a.model"), pickle.loads(pickle.dumps(fitted))):
        assert again.predict_proba(xyz).tobytes() == expected
        assert again.recipe_ == fitted.recipe_
    (tmp_path / "cut.model").write_bytes((tmp_path / "a.model").read_bytes()[:-9])
    with pytest.raises(scansion.FileFormatError):
        PointClassifier.load(tmp_path / "cut.model")
    with pytest.raises(FileNotFoundError):
        PointClassifier.load(tmp_path / "absent.model")


def test_a_stored_model_scores_as_before(tmp_path):
    base = pytest.importorskip("sklearn.base")
    xyz, labels = street(0)
    other, truth = street(1)
    large = labels.astype(np.uint16) * 100
    large[::5] = 77
    for unlabelled in ([2], np.array([77, 9]), {77}, None):
        codes = truth.astype(np.uint16) * 100
        codes[::7] = 77
        class_map = "200=2,500=6,600=6"
        fitted = PointClassifier(RECIPE, class_map=class_map, unlabelled=unlabelled, random_state=1).fit(xyz, large)
        fitted.save(tmp_path / "a.model")
        loaded = PointClassifier.load(tmp_path / "a.model")
        merged = np.select([codes == 200, codes == 77], [2, 77], 6)
        known = ~np.isin(merged, [] if unlabelled is None else list(unlabelled))
        accuracy = (fitted.predict(other) == merged)[known].mean()
        for again in (fitted, loaded, pickle.loads(pickle.dumps(loaded))):
            assert again.score(other, codes) == pytest.approx(accuracy)
        assert loaded.class_map == class_map
        assert (loaded.unlabelled is None) == (unlabelled is None)
        assert base.clone(loaded).fit(xyz, large).codes_.tolist() == fitted.codes_.tolist()
        # Python reads the file with safetensors' own layout: a length, a header of a multiple of 8 bytes, arrays.
        file = (tmp_path / "a.model").read_bytes()
        length = int.from_bytes(file[:8], "little")
        assert length % 8 == 0 and "scansion" in json.loads(file[8 : 8 + length])["__metadata__"]
        loaded.save(tmp_path / "b.model")
        assert (tmp_path / "b.model").read_bytes() == file


def test_results_repeat_for_any_number_of_threads(fitted):
    xyz, labels = street(0)
    other, _ = street(1)
    made = [PointClassifier(RECIPE, n_jobs=n).fit(xyz, labels).predict_proba(other) for n in (1, 2, 3, 8)]
    assert len({p.tobytes() for p in made}) == 1


def test_recipes_come_as_mapping_text_or_file(labelled, tmp_path):
    text = "seed = 3\n[forest]\ntrees = 7\n[features.pyramid]\nfirst_scale = 0.4\nlevels = 3\n"
    (tmp_path / "recipe.toml").write_text(text)
    by_text, by_file = (PointClassifier(r).fit(labelled) for r in (text, tmp_path / "recipe.toml"))
    assert by_text.recipe_ == by_file.recipe_ and "trees = 7" in by_text.recipe_
    with pytest.raises(ValueError, match="did you mean `trees`"):
        PointClassifier({"forest.treees": 7}).fit(labelled)
    assert PointClassifier(text, random_state=9).fit(labelled).recipe_.startswith('recipe = "pyramid"\nseed = 9')


def test_importances_belong_to_the_features(fitted):
    assert fitted.feature_importances_.shape == fitted.feature_names_in_.shape
    assert fitted.feature_importances_.sum() == pytest.approx(1)


def test_using_it_before_fit_is_refused():
    with pytest.raises(ValueError, match="not fitted"):
        PointClassifier().predict(np.zeros((3, 3)))


def test_the_built_in_model_is_there():
    default = PointClassifier.default()
    assert default.classes_.tolist() == [2, 5, 6]
    codes = default.predict(street(1)[0])
    assert set(np.unique(codes)) <= {2, 5, 6}


def test_the_built_in_model_says_what_it_has_no_class_for(fitted, tmp_path):
    def told(act):
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            act()
        assert {warning.filename for warning in warned} <= {__file__}, "warnings are told at the line of the caller"
        texts = [str(warning.message) for warning in warned]
        return [text for text in texts if "has no class for bridges, masts, water and cars" in text]

    xyz, codes = street(1)
    default = PointClassifier.default()
    default.save(tmp_path / "copy.model")
    loaded = PointClassifier.load(tmp_path / "copy.model")
    for model in (default, pickle.loads(pickle.dumps(default)), copy.deepcopy(default), loaded):
        (text,) = told(lambda model=model: model.classify(xyz))
        assert "which become ground, building or vegetation; cars, water and decks of bridges that are found" in text
        assert "`PointClassifier.fit` makes models with other classes" in text and "scansion train" not in text
        for plain in (model.predict, model.predict_proba):
            (text,) = told(lambda plain=plain: plain(xyz))
            assert "`classify` finds some of them and names places" in text and "are found become" not in text
    (text,) = told(lambda: default.classify(xyz, settings={"classes.water.named": True}))
    assert "; cars and decks of bridges that are found become unclassified, water that is found becomes water (9)" in text
    assert not told(lambda: fitted.classify(xyz)) and not told(lambda: fitted.predict(xyz))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "the built-in model has no class|.*beyond all of those in training")
        default.predict(xyz)
    assert not told(lambda: default.fit(xyz, codes).predict(xyz))


def test_pictures_have_the_asked_size(labelled, tmp_path):
    picture = scansion.render(labelled, tmp_path / "a.png", width=400)
    assert picture.shape[1:] == (400, 3) and picture.dtype == np.uint8 and picture.std() > 0
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert scansion.render(labelled, by="height", view="oblique", width=300, height=200).shape == (
        200,
        300,
        3,
    )
    codes = np.asarray(labelled["Classification"])
    plain = {"width": 300, "legend": False, "shading": False}
    same = scansion.render(labelled, truth=codes, **plain)
    other = scansion.render(labelled, truth=np.where(codes == 2, 9, codes), **plain)
    apart = scansion.render(labelled, truth=np.where(codes == 2, 9, codes), classes=[5, 6], **plain)
    red = [int((p[..., 0] > 100 + p[..., 1].astype(int)).sum()) for p in (same, other, apart)]
    assert red[0] == red[2] == 0 < red[1]
    with pytest.raises(ValueError, match="truth"):
        scansion.render(labelled, truth=codes[1:])
    with pytest.raises(ValueError, match=r"classes: found 300, expected a whole number in 0..255"):
        scansion.render(labelled, truth=codes, classes=[300])
    with pytest.raises(ValueError, match="view"):
        scansion.render(labelled, view="side")
    with pytest.raises(ValueError, match="Absent"):
        scansion.render(labelled, by="Absent")


def test_pictures_show_changes_and_leave_out_what_is_clipped():
    xyz, labels = street(0)
    cloud = scansion.PointCloud(xyz, Classification=labels)
    truth = np.where(labels == 5, 6, labels)
    plain, changes = (scansion.render(cloud, truth=truth, changes=c, width=400) for c in (False, True))
    assert plain.shape == changes.shape and (plain != changes).any()
    low = xyz[:, 2] < 2
    clipped = scansion.render(cloud, by="HEIGHT", clip=(-np.inf, 2), width=400, legend=False)
    np.testing.assert_array_equal(clipped, scansion.render(cloud[low], by="height", width=400, legend=False))
    with pytest.raises(ValueError, match="nearest: Classification"):
        scansion.render(cloud, by="clasification")


def test_scikit_learn_is_not_needed_to_import():
    code = "import sys; sys.modules['sklearn'] = None; import scansion; print(scansion.__version__)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout


def test_the_recipe_airborne_learns_in_two_stages():
    recipe = {
        "recipe": "airborne",
        "features.pyramid.first_scale": 0.5,
        "features.pyramid.levels": 4,
        "training.densities": [],
        "folds.square": 10.0,
        "forest.trees": 10,
        "boosting.rounds": 20,
    }
    xyz, labels = street(0)
    model = PointClassifier(recipe).fit(xyz, labels)
    assert model.report_["first_stage_accuracy"] > 0.8
    xyz, labels = street(1)
    assert model.predict(xyz).tolist() == model.classify(xyz, divided=False).codes.tolist()
    assert (model.predict(xyz) == labels).mean() > 0.9
    found = model.classify(xyz, abstain=0.9)
    assert set(found.codes.tolist()) <= {1, 2, 3, 4, 5, 6, 7, 18}
    assert (found.codes[(found.confidence < 0.9) & (found.codes != 18) & (found.codes != 7)] == 1).all()
    with pytest.raises(ValueError, match="abstain"):
        model.classify(xyz, abstain=2.0)


def parked(seed):
    """Flat ground of 60 x 60 m with cars (64) and bushes (5): coordinates and codes."""
    rng = np.random.default_rng(seed)
    xyz = np.column_stack([rng.random((36_000, 2)) * 60, rng.normal(0, 0.02, 36_000)])
    codes = np.full(len(xyz), 2)
    for number, (u, v) in enumerate((x, y) for x in range(4, 56, 8) for y in range(4, 56, 8)):
        along, across = (xyz[:, :2] - (u, v) - rng.random(2)).T
        if number % 2:
            inside = (along > 0) & (along < 4.5) & (across > 0) & (across < 1.8)
            xyz[inside, 2] += np.where((along > 1.2) & (along < 3.8), 1.5, 0.9)[inside]
        else:
            inside = np.hypot(along - 2, across - 2) < 1.5
            xyz[inside, 2] += 1.8 * rng.random(inside.sum())
        codes[inside] = 64 if number % 2 else 5
    return xyz, codes


def test_the_built_in_model_learns_cars_from_other_scans():
    xyz, codes = parked(1)
    model = PointClassifier.default().add_cars(xyz, codes, code=64)
    assert model.cars_report_["points"] == (codes == 64).sum() and model.cars_report_["cars"] > 100
    xyz, codes = parked(2)
    found = model.classify(xyz)
    taken_for = model.classify(xyz, settings={"classes.cars.points": 0}).codes
    changed = found.codes != taken_for
    assert (found.codes[changed] == 1).all() and np.isin(taken_for[changed], (3, 4, 5, 6)).all()
    cars = (codes == 64) & np.isin(taken_for, (3, 4, 5, 6))
    assert changed[cars].mean() > 0.5 and (codes[changed] == 64).mean() > 0.9
    assert not np.isin(1, model.predict(xyz)).any()
    again = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(again.classify(xyz).codes, found.codes)


def test_cars_need_a_fitting_model_and_labels(fitted):
    xyz, codes = parked(1)
    with pytest.raises(ValueError, match="pyramid cannot learn cars"):
        fitted.add_cars(xyz, codes, code=64)
    with pytest.raises(ValueError, match="0 samples of cars"):
        PointClassifier.default().add_cars(xyz, codes, code=65)
    with pytest.raises(ValueError, match="labels: found text"):
        PointClassifier.default().add_cars(xyz, np.where(codes == 64, "car", "other"), code=64)
    with pytest.raises(ValueError, match="code: found 300"):
        PointClassifier.default().add_cars(xyz, codes, code=300)
    with pytest.raises(ValueError, match="poinst"):
        PointClassifier.default().classify(xyz, settings={"classes.cars.poinst": 0})


def test_a_list_of_clouds_with_three_columns_is_a_list_of_clouds():
    clouds = []
    for seed in (0, 1):
        xyz, labels = street(seed)
        more = {name: np.ones(len(xyz), np.uint8) for name in ("ReturnNumber", "NumberOfReturns")}
        clouds.append(scansion.PointCloud(xyz, Classification=labels.astype(np.uint8), **more))
    given = [np.asarray(cloud["Classification"]) for cloud in clouds]
    model = PointClassifier(RECIPE).fit(clouds, given)
    assert sum(entry["points"] for entry in model.report_["classes"]) == sum(len(cloud) for cloud in clouds)


def test_training_chooses_a_regularisation_and_reports_the_comparison(fitted):
    choice = fitted.regularisation_
    tried = {(found["method"], found["strength"]) for found in choice["candidates"]}
    assert ("none", None) in tried and ("segment-crf", 1.0) in tried
    assert (choice["method"], choice["strength"]) in tried
    assert f'method = "{choice["method"]}"' in fitted.recipe_
    xyz, labels = street(0)
    assert PointClassifier({**RECIPE, "regularise.method": "none"}).fit(xyz, labels).regularisation_ is None


def flat(seed, side=40):
    """A plane whose classes only an own column tells: coordinates, codes and the column."""
    random = np.random.default_rng(seed)
    xyz = np.c_[random.random((side * side, 2)) * side, 0.05 * random.random(side * side)]
    codes = np.where(random.random(len(xyz)) < 0.5, 2, 6).astype(np.uint8)
    amplitude = (10.0 * codes + random.normal(0, 4, len(xyz))).astype(np.float32)
    return xyz, codes, amplitude


def test_columns_of_the_cloud_are_features():
    (xyz, codes, amplitude), (other, truth, values) = flat(0), flat(1)
    amplitude[::50] = np.nan
    recipe = {"features.pyramid.first_scale": 1.0, "features.pyramid.levels": 2, "training.voxel": 0.0}
    recipe |= {"forest.trees": 20, "regularise.method": "none"}
    plain = PointClassifier(recipe).fit(xyz, codes)
    model = PointClassifier({**recipe, "features.dimensions": ["Amplitude"]})
    model.fit(scansion.PointCloud(xyz, Amplitude=amplitude), codes)
    cloud = scansion.PointCloud(other, Amplitude=values)
    assert plain.score(other, truth) < 0.6 < 0.95 < model.score(cloud, truth)
    assert model.feature_names_in_[model.feature_importances_.argmax()] == "Amplitude"
    with pytest.raises(ValueError, match="column Amplitude"):
        model.predict(other)
    table = scansion.features.multiscale(cloud, first_scale=1.0, levels=2, dimensions=["Amplitude"])
    np.testing.assert_array_equal(table[:, -1], values)
    assert scansion.features.names(first_scale=1.0, levels=2, dimensions=["Amplitude"])[-1] == "Amplitude"


def test_weights_of_points_decide_between_labels_that_contradict_each_other():
    xyz, codes, _ = flat(2)
    half = xyz[:, 0] < 20
    wrong = np.where(half, 6, 2).astype(np.uint8)
    both = np.concatenate([xyz, xyz])
    labels = np.concatenate([8 - wrong, wrong])
    weight = np.repeat([5.0, 1.0], len(xyz))
    recipe = {"features.pyramid.first_scale": 1.0, "features.pyramid.levels": 6, "training.voxel": 0.0}
    recipe |= {"forest.trees": 20, "regularise.method": "none"}
    model = PointClassifier(recipe).fit(both, labels, sample_weight=weight)
    other = PointClassifier(recipe).fit(both, labels, sample_weight=6 - weight)
    first = (model.predict(both)[: len(xyz)] == labels[: len(xyz)]).mean()
    last = (other.predict(both)[: len(xyz)] == labels[: len(xyz)]).mean()
    assert last < 0.2 < 0.8 < first, (first, last)
    only = PointClassifier(recipe).fit(both, labels, sample_weight=weight > 1)
    assert sum(c["samples"] for c in only.report_["classes"]) <= len(xyz)
    with pytest.raises(ValueError, match="sample_weight"):
        PointClassifier(recipe).fit(both, labels, sample_weight=weight[1:])
    with pytest.raises(ValueError, match=r"training\.weight"):
        PointClassifier(recipe).fit(both, labels, sample_weight=-weight)


def test_clones_of_stored_models_are_fitted_by_their_recipe(tmp_path):
    base = pytest.importorskip("sklearn.base")
    built_in = PointClassifier.default()
    assert repr(built_in) == "PointClassifier(recipe='airborne')" == repr(base.clone(built_in))
    xyz, labels = street(0)
    fitted = PointClassifier(RECIPE, random_state=3).fit(xyz, labels, sample_weight=np.ones(len(xyz)))
    fitted.save(tmp_path / "a.model")
    loaded = PointClassifier.load(tmp_path / "a.model")
    assert loaded.classes_.tolist() == [2, 5, 6] and "pyramid" in repr(loaded) and len(repr(loaded)) < 60
    again = base.clone(loaded).fit(xyz, labels)
    assert again.predict_proba(xyz).tobytes() == fitted.predict_proba(xyz).tobytes()


def las_cloud(seed=0):
    """A street with the codes of LAS, every fifth point unclassified."""
    xyz, labels = street(seed)
    labels[::5] = 1
    cloud = scansion.PointCloud(xyz, Classification=labels)
    cloud.scheme = "asprs"
    return cloud


def test_codes_beside_a_cloud_belong_to_its_class_list(recwarn):
    cloud, other = las_cloud(), las_cloud(1)
    codes, expected = cloud["Classification"], PointClassifier(RECIPE).fit(cloud)
    for pair in ((cloud, codes), (cloud.to_pandas(),), (cloud.to_pandas(), codes.tolist())):
        fitted = PointClassifier(RECIPE).fit(*pair)
        assert fitted.classes_.tolist() == [2, 5, 6] and fitted.class_names_ == expected.class_names_
        assert fitted.class_names_[0] == "ground" and fitted.report_["unlabelled"] == (codes == 1).sum()
    assert PointClassifier(RECIPE).fit(cloud.xyz, codes).classes_.tolist() == [1, 2, 5, 6]
    assert PointClassifier(RECIPE, unlabelled=[]).fit(cloud, codes).classes_.tolist() == [1, 2, 5, 6]
    accuracy = expected.score(other)
    assert accuracy == expected.score(other, other["Classification"]) == expected.score(other.to_pandas()[::1])
    assert accuracy > expected.score(other.xyz, other["Classification"]) + 0.1
    assert not [w for w in recwarn if "unlabelled" in str(w.message)]
    text = np.where(cloud["Classification"] == 2, "ground", "other")
    assert PointClassifier(RECIPE).fit(cloud, text).report_["unlabelled"] == 0
    found = scansion.search(cloud, codes, recipe=RECIPE, folds=2)
    assert [row["code"] for row in found.tried[0]["scores"]["labels"]] == [2, 5, 6]


def test_codes_that_the_class_list_leaves_out_are_warned_of():
    cloud = las_cloud()
    own = np.where(cloud["Classification"] == 2, 1, 2)
    own[: len(own) // 4] = 3
    with pytest.warns(UserWarning, match=r"points of code 1 count as unlabelled.*'asprs'.*unlabelled=\[\]"):
        assert PointClassifier(RECIPE).fit(cloud, own).classes_.tolist() == [2, 3]


def test_pictures_refuse_options_that_would_change_nothing(labelled):
    truth = np.asarray(labelled["Classification"])
    for options, name in [
        ({"classes": [5]}, "classes"),
        ({"changes": True}, "changes"),
        ({"truth": truth, "by": "height"}, "by"),
    ]:
        with pytest.raises(ValueError, match=f"^{name}: found"):
            scansion.render(labelled, width=300, **options)
    scansion.render(labelled, by="class", truth=truth, width=300)


def test_scores_of_labels_of_another_kind_are_refused(fitted):
    xyz, labels = street(1)
    with pytest.raises(ValueError, match="labels: found text, expected numbers"):
        fitted.score(xyz, np.where(labels == 2, "ground", "wall"))
