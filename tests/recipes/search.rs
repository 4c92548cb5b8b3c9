//! Cross-validation and grids of settings of whole recipes, on small scenes.

use scansion_core::cloud::{Cloud, Column, Values};
use scansion_core::parallel::Monitor;
use scansion_core::random::stream;
use scansion_core::recipes::{
    AnyRecipe, ClassifyParams, Grid, LabelParams, LabelledCloud, SearchParams, TrainOptions, classify, read_labels,
    search,
};
use scansion_tests::street;

const PYRAMID: [&str; 5] = [
    "features.pyramid.first_scale=0.4",
    "features.pyramid.levels=3",
    "forest.trees=8",
    "training.voxel=0.2",
    "regularise.method=none",
];

fn recipe(name: &str, settings: &[&str]) -> AnyRecipe {
    AnyRecipe::named(name).unwrap().with_settings(settings.iter().copied()).unwrap()
}

fn labelled(cloud: Cloud) -> LabelledCloud {
    let labels = read_labels(&cloud, &LabelParams::default()).unwrap();
    LabelledCloud { cloud, labels }
}

/// A street at a quarter of its size: 7.5 m, as large as an office.
fn small(seed: u64) -> Cloud {
    let scene = street(30.0, seed);
    let rows: Vec<[f64; 3]> = (0..scene.len()).map(|i| scene.xyz(i).map(|v| v / 4.0)).collect();
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(scene.column("Classification").unwrap().clone()).unwrap();
    cloud
}

#[test]
fn a_grid_over_any_key_finds_the_better_settings_on_a_small_scene() {
    let mut clouds = [labelled(small(1))];
    let before = clouds[0].labels.clone();
    let axes = ["forest.max_depth=1,12", "features.pyramid.levels=1,3"].map(|text| text.parse().unwrap());
    let params = SearchParams { grid: Grid { axes: axes.to_vec() }, folds: 3, ..SearchParams::default() };
    let found = search(&recipe("pyramid", &PYRAMID), &mut clouds, &params, &Monitor::default()).unwrap();
    assert_eq!(clouds[0].labels, before, "the labels are back");
    assert_eq!(found.tried.len(), 4);
    assert!(found.block < 7.5, "squares fit the scene: {}", found.block);
    let known = before.codes.iter().flatten().count() as u64;
    assert!(found.tried.iter().all(|trial| trial.scores.points == known), "every labelled point is held out once");
    let best = &found.tried[found.best];
    assert!(best.settings[0] == "forest.max_depth=12" && best.scores.mean_f1_score > 0.8, "{}", found.text());
    assert!(found.tried[0].scores.mean_f1_score < best.scores.mean_f1_score);
    assert!(found.text().contains("forest.max_depth=12") && found.text().contains("best"));
}

#[test]
fn held_out_points_are_not_learned_from() {
    // Labels that mean nothing: a model knows those it was trained on, and half of the others.
    let mut cloud = small(2);
    let mut random = stream(5, 0);
    let codes: Vec<u8> = (0..cloud.len()).map(|_| 2 + 4 * random.below(2) as u8).collect();
    cloud.set_column(Column::new("Classification", Values::U8(codes.clone()))).unwrap();
    let settings = [&PYRAMID[..], &["training.voxel=0.0", "forest.max_depth=none"]].concat();
    let (recipe, mut clouds) = (recipe("pyramid", &settings), [labelled(cloud)]);
    let (model, _) = recipe.train(&clouds, &TrainOptions::default(), &Monitor::default()).unwrap();
    let again = classify(&clouds[0].cloud, &model, &ClassifyParams::default(), &Monitor::default()).unwrap();
    let right = again.codes.iter().zip(&codes).filter(|(a, b)| a == b).count() as f64 / codes.len() as f64;
    assert!(right > 0.85, "{right}");
    let params = SearchParams { folds: 2, ..SearchParams::default() };
    let found = search(&recipe, &mut clouds, &params, &Monitor::default()).unwrap();
    let accuracy = found.tried[0].scores.overall_accuracy;
    assert!((accuracy - 0.5).abs() < 0.05, "{accuracy}");
}

#[test]
fn every_recipe_can_be_cross_validated_and_few_squares_are_explained() {
    let mut clouds = [labelled(street(30.0, 3))];
    let weak = recipe("weak", &["labels.per_class=40", "neighbourhood.k_max=20", "features.pyramid.levels=2"]);
    let objects = recipe("objects", &["training.share=1.0", "segments.slic.size=2.0", "forest.trees=10"]);
    for recipe in [weak, objects] {
        let params = SearchParams { folds: 2, ..SearchParams::default() };
        let found = search(&recipe, &mut clouds, &params, &Monitor::default()).unwrap();
        assert!(found.tried[0].scores.overall_accuracy > 0.7, "{}: {}", recipe.name(), found.text());
    }
    let params = SearchParams { block: Some(100.0), ..SearchParams::default() };
    let recipe = recipe("pyramid", &PYRAMID);
    let message = search(&recipe, &mut clouds, &params, &Monitor::default()).unwrap_err().to_string();
    assert!(message.contains("squares of 100 m") && message.contains("smaller squares"), "{message}");
    let grid = Grid { axes: vec!["forest.depht=1".parse().unwrap()] };
    let params = SearchParams { grid, ..SearchParams::default() };
    let message = search(&recipe, &mut clouds, &params, &Monitor::default()).unwrap_err().to_string();
    assert!(message.contains("did you mean"), "{message}");
}
