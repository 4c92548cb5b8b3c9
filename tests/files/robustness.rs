//! Bad input gives a defined result or a clear error.

use scansion_core::Error;
use scansion_core::cloud::{Cloud, CodeScheme, Column, Values};
use scansion_core::features::{self, FeatureSet};
use scansion_core::io::{self, Edit, WriteOptions};
use scansion_core::parallel::Monitor;
use scansion_core::recipes::Model;
use scansion_core::recipes::{
    AnyRecipe, ClassifyParams, LabelParams, LabelledCloud, TrainOptions, classify, default_model, read_labels,
};
use scansion_tests::{demo_scan, street};
use std::path::Path;
use std::time::{Duration, Instant};

fn set() -> FeatureSet {
    let mut set = FeatureSet::default();
    set.pyramid.first_scale = Some(0.25);
    set
}

/// Degenerate clouds give defined numbers.
#[test]
fn features_of_degenerate_clouds_are_finite() {
    let line = |n: i32| (0..n).map(|i| [f64::from(i) * 0.3, f64::from(i) * 0.3, 0.0]).collect::<Vec<_>>();
    let plane: Vec<[f64; 3]> = (0..400).map(|i| [f64::from(i % 20) * 0.5, f64::from(i / 20) * 0.5, 7.0]).collect();
    let clouds = [vec![], line(1), line(2), line(3), line(40), vec![[1.0, 2.0, 3.0]; 1000], plane];
    for rows in clouds {
        let cloud = Cloud::from_rows(&rows).unwrap();
        let table = features::table(&cloud, &set(), &Monitor::default()).unwrap();
        assert_eq!(table.rows(), rows.len());
        assert!(table.values.iter().all(|v| v.is_finite()), "{} points", rows.len());
        let named =
            classify(&cloud, &default_model().unwrap(), &ClassifyParams::default(), &Monitor::default()).unwrap();
        assert_eq!(named.codes.len(), rows.len());
    }
}

/// Points that are not finite are counted, left out of the neighbourhoods and stay unclassified.
#[test]
fn points_that_are_not_finite_change_nothing_for_the_others() {
    let scene = street(15.0, 1);
    let mut rows: Vec<[f64; 3]> = (0..scene.len()).map(|i| scene.xyz(i)).collect();
    rows.insert(5, [f64::NAN, 0.0, 0.0]);
    rows.push([0.0, f64::INFINITY, 0.0]);
    let broken = Cloud::from_rows(&rows).unwrap();
    let (model, monitor) = (default_model().unwrap(), Monitor::default());
    let clean = classify(&scene, &model, &ClassifyParams::default(), &monitor).unwrap();
    let named = classify(&broken, &model, &ClassifyParams::default(), &monitor).unwrap();
    assert_eq!((named.codes[5], named.confidence[5].to_bits(), named.codes[rows.len() - 1]), (1, 0, 1));
    assert!(named.warnings[0].contains("2 points"));
    let others: Vec<u8> = (0..rows.len() - 1).filter(|&i| i != 5).map(|i| named.codes[i]).collect();
    assert!(others == clean.codes);
}

/// Many coincident points, or points with one equal coordinate, cost no more than others.
#[test]
fn a_million_identical_points_take_no_longer_than_random_ones() {
    let n = 200_000;
    let time = |rows: Vec<[f64; 3]>| {
        let cloud = Cloud::from_rows(&rows).unwrap();
        let start = Instant::now();
        let named =
            classify(&cloud, &default_model().unwrap(), &ClassifyParams::default(), &Monitor::default()).unwrap();
        assert_eq!(named.codes.len(), rows.len());
        start.elapsed()
    };
    let street = street(130.0, 2);
    let random = time((0..n).map(|i| street.xyz(i)).collect());
    let identical = time(vec![[3.0, 4.0, 5.0]; n]);
    let lattice = time((0..n).map(|i| [(i % 500) as f64 * 0.25, (i / 500) as f64 * 0.25, 0.0]).collect());
    // A generous bound: this guards against quadratic behaviour, not against noise.
    let most = 10 * random + Duration::from_secs(5);
    assert!(identical < most && lattice < most, "{random:?} {identical:?} {lattice:?}");
}

/// A tiny voxel in a huge extent is refused before anything is allocated.
#[test]
fn a_huge_extent_with_a_tiny_voxel_is_an_error() {
    let cloud = Cloud::from_rows(&[[0.0; 3], [1e8, 0.0, 0.0]]).unwrap();
    let error = features::table(&cloud, &set(), &Monitor::default()).unwrap_err();
    assert!(matches!(&error, Error::InvalidParameter { name: "first_scale", .. }), "{error}");
}

/// No label at all, or one class only.
#[test]
fn training_needs_a_label_and_works_with_one_class() {
    let mut scene = street(15.0, 1);
    let recipe = AnyRecipe::named("pyramid")
        .unwrap()
        .with_settings(["features.pyramid.first_scale=0.5", "features.pyramid.levels=3", "forest.trees=3"])
        .unwrap();
    let with_code = |scene: &mut Cloud, code: u8| {
        scene.set_column(Column::new("Classification", Values::U8(vec![code; scene.len()]))).unwrap();
        scene.scheme = CodeScheme::Asprs;
        let labels = read_labels(scene, &LabelParams::default()).unwrap();
        recipe.train(&[LabelledCloud { cloud: scene.clone(), labels }], &TrainOptions::default(), &Monitor::default())
    };
    let message = with_code(&mut scene, 1).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("no labelled point"), "{message}");
    let message = with_code(&mut scene, 6).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("only one class to learn, code 6"), "{message}");
}

/// A model whose columns the cloud lacks, and one whose recipe gives other features.
#[test]
fn a_model_that_does_not_fit_is_refused_with_the_name_of_what_is_missing() {
    let mut scene = street(15.0, 1);
    let n = scene.len();
    scene.set_column(Column::new("Intensity", Values::U16((0..n).map(|i| (i % 100) as u16).collect()))).unwrap();
    let settings =
        ["features.pyramid.first_scale=0.5", "features.pyramid.levels=2", "features.intensity=true", "forest.trees=3"];
    let recipe = AnyRecipe::named("pyramid").unwrap().with_settings(settings).unwrap();
    let labels = read_labels(&scene, &LabelParams::default()).unwrap();
    let (model, _) = recipe
        .train(&[LabelledCloud { cloud: scene.clone(), labels }], &TrainOptions::default(), &Monitor::default())
        .unwrap();
    let bare = street(15.0, 2);
    let message = classify(&bare, &model, &ClassifyParams::default(), &Monitor::default()).unwrap_err().to_string();
    assert!(message.contains("Intensity"), "{message}");
    let fitted = model.fitted.with_settings(["features.pyramid.first_scale=0.7"]).unwrap();
    let other = Model { fitted, ..model };
    let error = classify(&scene, &other, &ClassifyParams::default(), &Monitor::default()).unwrap_err();
    assert!(matches!(error, Error::ModelMismatch(_)), "{error}");
}

/// An output that cannot be written is an error and leaves nothing behind.
#[test]
fn an_output_that_cannot_be_written_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("absent").join("out.laz");
    let error = io::rewrite(&demo_scan(), &target, &[], &WriteOptions::default()).unwrap_err();
    assert!(error.to_string().contains("absent"), "{error}");
    let wrong = [Edit::Classification(vec![2; 3])];
    let path = folder.path().join("out.laz");
    assert!(io::rewrite(&demo_scan(), &path, &wrong, &WriteOptions::default()).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A cancelled run ends soon and leaves nothing behind.
#[test]
fn cancelled_work_ends_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let options = WriteOptions::default();
    options.monitor.cancel();
    let error = io::rewrite(&demo_scan(), &folder.path().join("out.laz"), &[], &options).unwrap_err();
    assert!(matches!(error, Error::Interrupted));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    assert!(!Path::new("out.laz").exists());
}

/// Coordinates so large that the edge of a patch, on which regularisations are compared, is rounded away. A damaged file
/// that the search for such files found.
#[test]
fn coordinates_without_room_for_a_patch_are_learned_from_or_refused() {
    let cloud = io::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/huge_steps.las")).unwrap();
    let labels = read_labels(&cloud, &LabelParams::default()).unwrap();
    let settings = ["forest.trees=3", "training.keep_samples=50"];
    let recipe = AnyRecipe::named("pyramid").unwrap().with_settings(settings).unwrap();
    let trained = recipe.train(&[LabelledCloud { cloud, labels }], &TrainOptions::default(), &Monitor::default());
    assert!(trained.map_or_else(|e| !e.to_string().is_empty(), |(model, _)| model.trained.classes.len() > 1));
}
