//! The recipe of Guinard & Landrieu 2017 end to end: few labels, segments, random field.

use rayon::prelude::*;
use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::evaluation::Confusion;
use scansion_core::io;
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{
    AnyRecipe, ClassifyParams, LabelParams, LabelledCloud, Labels, Model, Regularise, SegmentParams, System,
    TrainOptions, TrainingResult, WeakRecipe, classify, read_labels, segment, statistics,
};
use scansion_core::segmentation::{Intent, PartitionParams};
use scansion_tests::{data, street};

fn weak(settings: &[&str]) -> WeakRecipe {
    match AnyRecipe::named("weak").unwrap().with_settings(settings.iter().copied()).unwrap() {
        AnyRecipe::Weak(recipe) => *recipe,
        _ => unreachable!("the weak recipe was asked for"),
    }
}

/// Overall accuracy and mean F1 of each method, in percent, for one seed.
fn scores(cloud: &Cloud, labels: &Labels, settings: &[&str], seed: u64) -> Vec<(f64, f64)> {
    let settings = [&["labels.per_class=15", "neighbourhood.k_step=10"], settings].concat();
    let recipe = WeakRecipe { seed, ..weak(&settings) };
    let monitor = Monitor::default();
    let TrainingResult { fitted, trained, report } = recipe
        .train(&[LabelledCloud { cloud: cloud.clone(), labels: labels.clone() }], &TrainOptions::default(), &monitor)
        .unwrap();
    let model = Model { fitted: fitted.into(), trained };
    assert!(report.classes.iter().all(|c| c.samples == 15));
    let methods = [Regularise::None, Regularise::PointCrf, Regularise::Consensus, Regularise::SegmentCrf];
    methods
        .iter()
        .map(|&method| {
            let params = ClassifyParams { regularise: Some(method), ..ClassifyParams::default() };
            let found = classify(cloud, &model, &params, &monitor).unwrap();
            let scores = Confusion::from_options(&labels.codes, &found.codes).unwrap().scores();
            (100.0 * scores.overall_accuracy, 100.0 * scores.mean_f1_score)
        })
        .collect()
}

/// Draws of the labels.
const SEEDS: u64 = 3;

/// The experiment of the paper on one street: reference implementations reach 92.4/97.3/97.3/97.9 % and
/// 70.7/85.1/84.3/87.0 %.
#[test]
fn fifteen_labels_a_class_name_an_oakland_street() {
    let Some(folder) = data() else { return };
    let cloud = io::read(&folder.join("oakland/part_14.laz")).unwrap();
    let params = LabelParams { classes: vec![2, 5, 6, 14, 15], ..LabelParams::default() };
    let labels = read_labels(&cloud, &params).unwrap();
    let means = |settings: &[&str]| {
        let runs: Vec<Vec<(f64, f64)>> =
            (0..SEEDS).into_par_iter().map(|seed| scores(&cloud, &labels, settings, seed)).collect();
        let mean = |method: usize| {
            let sum = runs.iter().fold((0.0, 0.0), |sum, run| (sum.0 + run[method].0, sum.1 + run[method].1));
            (sum.0 / SEEDS as f64, sum.1 / SEEDS as f64)
        };
        let found = [0, 1, 2, 3].map(mean);
        println!("{settings:?}: alone, point field, consensus, segment field {found:.1?}");
        found
    };
    let paper = ["descriptors=paper", "shares.power=0", "labels.hold=false"];
    let [alone, points, consensus, segments] = means(&paper);
    assert!(consensus.0 > alone.0 + 2.0);
    assert!(segments.1 > alone.1 + 8.0);
    assert!(points.0 > alone.0 + 2.0 && segments.0 > consensus.0 - 0.2);
    assert!(segments.0 > 97.0 && segments.1 > 84.0);
    let [more_alone, more_points, _, more] = means(&[]);
    assert!(more_alone.0 > alone.0 && more_alone.1 > alone.1, "more descriptors and shares help");
    assert!(more.0 > more_points.0 - 0.1 && more_points.0 > more_alone.0, "the field on segments is no worse");
    assert!(more.1 > more_points.1 - 0.1 && more_points.1 > more_alone.1, "nor in its mean F1");
    assert!(more.0 > 97.5 && more.1 > 87.0);
}

#[test]
fn models_labels_and_segments_are_the_same_for_1_2_3_and_8_threads() {
    let scene = street(25.0, 4);
    let labels = read_labels(&scene, &LabelParams::default()).unwrap();
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let monitor = Monitor::default();
            let recipe = weak(&["labels.per_class=20", "forest.trees=20", "neighbourhood.k_step=10"]);
            let options = TrainOptions { strengths: vec![0.3, 1.0], ..TrainOptions::default() };
            let TrainingResult { fitted, trained, report } = recipe
                .train(&[LabelledCloud { cloud: scene.clone(), labels: labels.clone() }], &options, &monitor)
                .unwrap();
            let model = Model { fitted: fitted.into(), trained };
            let named = classify(&scene, &model, &ClassifyParams::default(), &monitor).unwrap();
            let intent = Intent::SegmentsPerHectare(500.0);
            let params = SegmentParams {
                partition: PartitionParams { intent, ..PartitionParams::default() },
                ..SegmentParams::default()
            };
            let parted = segment(&scene, Some(&labels), &params, &monitor).unwrap();
            // As text, in which a score that is not defined equals itself.
            (model.to_bytes().unwrap(), report, named, format!("{parted:?}"))
        })
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        assert!(one == run(threads), "{threads} threads");
    }
}

#[test]
fn a_model_with_a_field_names_another_street_and_any_model_can_have_one() {
    let (scene, other) = (street(30.0, 5), street(30.0, 6));
    let labels = read_labels(&scene, &LabelParams::default()).unwrap();
    let truth = read_labels(&other, &LabelParams::default()).unwrap();
    let monitor = Monitor::default();
    let right = |codes: &[u8]| {
        let hits = codes.iter().zip(&truth.codes).filter(|(c, t)| Some(**c) == **t).count();
        hits as f64 / codes.len() as f64
    };
    let model = Model::from(
        weak(&["labels.per_class=25"])
            .train(&[LabelledCloud { cloud: scene, labels }], &TrainOptions::default(), &monitor)
            .unwrap(),
    );
    let named = classify(&other, &model, &ClassifyParams::default(), &monitor).unwrap();
    assert!(right(&named.codes) > 0.9, "{}", right(&named.codes));
    let pyramid = scansion_core::recipes::default_model().unwrap();
    for method in [Regularise::Local, Regularise::PointCrf, Regularise::SegmentCrf] {
        let params = ClassifyParams { regularise: Some(method), probabilities: true, ..ClassifyParams::default() };
        let found = classify(&other, &pyramid, &params, &monitor).unwrap();
        assert_eq!(found.probabilities.unwrap().len(), other.len() * 3);
    }
}

/// A cloud with a code for each point; 0 is unlabelled.
fn labelled(rows: &[[f64; 3]], codes: &[u8]) -> LabelledCloud {
    let mut cloud = Cloud::from_rows(rows).unwrap();
    cloud.set_column(Column::new("Classification", Values::U8(codes.to_vec()))).unwrap();
    let labels = read_labels(&cloud, &LabelParams { unlabelled: Some(vec![0]), ..LabelParams::default() }).unwrap();
    LabelledCloud { cloud, labels }
}

fn names(rows: &[[f64; 3]], codes: &[u8], settings: &[&str]) -> Result<Vec<u8>, String> {
    let pair = [labelled(rows, codes)];
    let monitor = Monitor::default();
    let model = Model::from(
        weak(&[&["forest.trees=30"], settings].concat())
            .train(&pair, &TrainOptions::default(), &monitor)
            .map_err(|e| e.to_string())?,
    );
    Ok(classify(&pair[0].cloud, &model, &ClassifyParams::default(), &monitor).map_err(|e| e.to_string())?.codes)
}

#[test]
fn a_unit_of_the_recipe_counts_for_the_density_too() {
    let rows: Vec<[f64; 3]> = (0..1600).map(|i| [f64::from(i % 40), f64::from(i / 40), 0.0]).collect();
    let codes: Vec<u8> = (0..1600).map(|i| if i % 40 < 20 { 2 } else { 6 }).collect();
    let recipe = weak(&["features.metres_per_unit=0.5", "labels.per_class=15"]);
    let model =
        Model::from(recipe.train(&[labelled(&rows, &codes)], &TrainOptions::default(), &Monitor::default()).unwrap());
    // A point every half metre.
    assert!((3.5..4.5).contains(&model.trained.fingerprint.density), "{}", model.trained.fingerprint.density);
}

#[test]
fn odd_clouds_and_labels_are_named_or_refused_but_never_break() {
    let plane: Vec<[f64; 3]> = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 0.0]).collect();
    let mut one = vec![0; 400];
    one[7] = 6;
    assert!(names(&plane, &one, &[]).unwrap_err().contains("only one class"));
    one[390] = 2;
    assert!(names(&plane, &[0; 400], &[]).unwrap_err().contains("no labelled point"));
    assert!(names(&[[1.0, 2.0, 3.0]], &[2], &[]).is_err());
    assert_eq!(names(&[[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]], &[2, 6], &[]).unwrap().len(), 2);
    let thirty: Vec<u8> = (0..30).map(|i| if i < 15 { 2 } else { 6 }).collect();
    assert_eq!(names(&vec![[5.0; 3]; 30], &thirty, &[]).unwrap().len(), 30);
    let far: Vec<[f64; 3]> = plane.iter().copied().chain(plane.iter().map(|p| [p[0] + 5e4, p[1], p[2]])).collect();
    let mut two = vec![0; 800];
    (two[3], two[500]) = (2, 6);
    assert_eq!(names(&far, &two, &[]).unwrap().len(), 800, "a graph in pieces");
    let mut holes = plane.clone();
    holes[11] = [f64::NAN; 3];
    let codes = names(&holes, &one, &[]).unwrap();
    assert!(codes[11] == 1 && codes[12] != 1, "points that are not finite stay unclassified");
    for strength in ["0.0", "inf"] {
        let field = format!("regularise.strength={strength}");
        let partition = format!("regularise.partition.intent.strength={strength}");
        assert_eq!(names(&plane, &one, &[&field, &partition]).unwrap().len(), 400);
    }
}

#[test]
fn three_classes_can_have_weights_of_their_own() {
    // Three steps; the middle one is road, or none is.
    let rows: Vec<[f64; 3]> =
        (0..900).map(|i| [f64::from(i % 30), f64::from(i / 30), f64::from(i % 30 / 10)]).collect();
    let weights = "forest.class_weight={ per_class = [1.0, 5.0, 2.0] }";
    for steps in [[5, 2, 6], [4, 5, 6]] {
        let codes: Vec<u8> = (0..900).map(|i| steps[i % 30 / 10]).collect();
        assert_eq!(names(&rows, &codes, &[weights, "forest.trees=20"]).unwrap().len(), 900, "{steps:?}");
    }
    // One weight a class, not one for road and one for the others.
    let codes: Vec<u8> = (0..900).map(|i| [5, 2, 6][i % 30 / 10]).collect();
    assert!(names(&rows, &codes, &["forest.class_weight={ per_class = [1.0, 5.0] }"]).is_err());
}

#[test]
fn training_and_classification_tell_of_a_road_that_was_not_found() {
    let rows: Vec<[f64; 3]> =
        (0..900).map(|i| [f64::from(i % 30), f64::from(i / 30), f64::from(i % 30 / 15)]).collect();
    let codes: Vec<u8> = (0..900).map(|i| if i % 30 < 15 { 5 } else { 6 }).collect();
    let (pair, monitor) = ([labelled(&rows, &codes)], Monitor::default());
    let result = weak(&["forest.trees=10"]).train(&pair, &TrainOptions::default(), &monitor).unwrap();
    let text = "no label is road (road.codes [2, 11]): the lowest points stand in for the road";
    assert_eq!(result.report.warnings, [text]);
    let found = classify(&pair[0].cloud, &Model::from(result), &ClassifyParams::default(), &monitor).unwrap();
    assert!(found.warnings.iter().any(|warning| warning == text), "{:?}", found.warnings);
}

#[test]
fn parts_get_the_labels_of_the_whole_if_its_statistics_are_known() {
    // Sites so far apart that nothing but the class shares joins them.
    let exact = |v: f64| (v * 64.0).round() / 64.0;
    let site = |seed: u64, east: f64| -> Vec<[f64; 3]> {
        let cloud = street(30.0, seed);
        let rows = (0..cloud.len()).map(|i| cloud.xyz(i).map(exact));
        // The corner from which voxels are counted.
        rows.chain([[0.0, 0.0, -0.5]]).map(|[x, y, z]| [x + east, y, z]).collect()
    };
    // The second site is nearly bare, so that its own shares are far from those of both.
    let bare: Vec<[f64; 3]> = site(8, 4096.0).into_iter().filter(|p| p[2] < 1.0).collect();
    let sites = [site(7, 0.0), bare];
    let scene = street(30.0, 5);
    let labels = read_labels(&scene, &LabelParams::default()).unwrap();
    // The six descriptors alone: the coarse levels of a pyramid reach from one site to the other.
    let settings = ["labels.per_class=25", "shares.power=1", "descriptors=paper", "regularise.method=none"];
    let monitor = Monitor::default();
    let model = Model::from(
        weak(&settings).train(&[LabelledCloud { cloud: scene, labels }], &TrainOptions::default(), &monitor).unwrap(),
    );
    let params = ClassifyParams::default();
    let whole = classify(&Cloud::from_rows(&sites.concat()).unwrap(), &model, &params, &monitor).unwrap();
    let parts = sites.map(|rows| Cloud::from_rows(&rows).unwrap());
    let of = |part: &Cloud| statistics(part, &model, &params, &monitor).unwrap();
    let all = of(&parts[0]).with(&of(&parts[1])).unwrap();
    assert_eq!(all.class_counts.iter().sum::<u64>() as usize, whole.codes.len());
    let known = ClassifyParams { statistics: Some(all), ..params.clone() };
    // Mean difference of the confidences, and number of points with another class.
    let differ = |params: &ClassifyParams| {
        let found: Vec<_> = parts.iter().map(|part| classify(part, &model, params, &monitor).unwrap()).collect();
        let confidence = found.iter().flat_map(|f| &f.confidence).zip(&whole.confidence);
        let codes = found.iter().flat_map(|f| &f.codes).zip(&whole.codes);
        let mean = confidence.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / whole.codes.len() as f64;
        (mean, codes.filter(|(a, b)| a != b).count())
    };
    let (known, alone) = (differ(&known), differ(&params));
    println!("mean difference of confidence, other classes: {known:?} with, {alone:?} without statistics");
    assert!(known.0 < 1e-4 && known.1 <= 2, "{known:?}");
    assert!(alone.0 > 0.01, "the shares of a part are not those of the whole: {alone:?}");
}

#[test]
fn the_finest_scale_of_the_features_is_that_of_the_spacing() {
    // On a lattice the spacing is the step; scales are 0.025 m times a power of two: 0.1, and 0.8 (1.6 is farther from 1).
    for (step, name) in [(0.1, "Planarity_r0p1"), (1.0, "Planarity_r0p8")] {
        let at = |i: usize| step * (i as f64);
        let ground = (0..1600).map(|i| [at(i % 40), at(i / 40), 0.0]);
        let wall = (0..1600).map(|i| [at(i % 40), at(20), at(i / 40 + 1)]);
        let rows: Vec<[f64; 3]> = ground.chain(wall).collect();
        let codes: Vec<u8> = (0..3200).map(|i| if i % 100 > 0 { 0 } else { 2 + 4 * u8::from(i >= 1600) }).collect();
        let recipe = weak(&["features.pyramid.levels=2", "neighbourhood.k_max=12", "forest.trees=5"]);
        let model = Model::from(
            recipe.train(&[labelled(&rows, &codes)], &TrainOptions::default(), &Monitor::default()).unwrap(),
        );
        assert!(model.trained.feature_names.iter().any(|n| n == name), "{:?}", model.trained.feature_names);
    }
}
