//! The same bytes for any number of threads: features, models, labels, files.

use scansion_core::features::{self, FeatureSet};
use scansion_core::io::{self, WriteOptions};
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{
    AnyRecipe, ClassifyParams, LabelParams, LabelledCloud, Model, PyramidRecipe, System, TrainOptions, TrainingResult,
    classify, default_model, read_labels,
};
use scansion_tests::street;

fn with<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

fn small_recipe() -> PyramidRecipe {
    let settings = [
        "features.pyramid.first_scale=0.4",
        "features.pyramid.levels=5",
        "forest.trees=9",
        "training.max_samples=4000",
    ];
    match AnyRecipe::named("pyramid").unwrap().with_settings(settings).unwrap() {
        AnyRecipe::Pyramid(recipe) => *recipe,
        _ => unreachable!("the pyramid recipe was asked for"),
    }
}

#[test]
fn features_models_labels_and_files_are_the_same_for_1_2_3_and_8_threads() {
    let (scene, other) = (street(40.0, 1), street(30.0, 2));
    let labels = read_labels(&scene, &LabelParams::default()).unwrap();
    let pair = [LabelledCloud { cloud: scene.clone(), labels }];
    let folder = tempfile::tempdir().unwrap();
    let run = |threads: usize| {
        with(threads, || {
            let monitor = Monitor::default();
            let recipe = small_recipe();
            let table = features::table(&scene, &recipe.features, &monitor).unwrap();
            let TrainingResult { fitted, trained, report } =
                recipe.train(&pair, &TrainOptions::default(), &monitor).unwrap();
            let model = Model { fitted: fitted.into(), trained };
            let named = classify(
                &other,
                &model,
                &ClassifyParams { probabilities: true, ..ClassifyParams::default() },
                &monitor,
            )
            .unwrap();
            let path = folder.path().join(format!("{threads}.laz"));
            io::write(&path, &other, &WriteOptions::default()).unwrap();
            let bits: Vec<u32> = table.values.iter().map(|v| v.to_bits()).collect();
            (bits, model.to_bytes().unwrap(), report, named, std::fs::read(path).unwrap())
        })
    };
    let one = run(1);
    for threads in [2, 3, 8] {
        let other = run(threads);
        assert!(one.0 == other.0, "features with {threads} threads");
        assert!(one.1 == other.1, "model with {threads} threads");
        assert!(one.2 == other.2, "report with {threads} threads");
        assert!(one.3 == other.3, "labels with {threads} threads");
        assert!(one.4 == other.4, "file with {threads} threads");
    }
}

#[test]
fn a_model_learned_on_one_street_names_another() {
    let monitor = Monitor::default();
    let scene = street(40.0, 1);
    let labels = read_labels(&scene, &LabelParams::default()).unwrap();
    let model = Model::from(
        small_recipe().train(&[LabelledCloud { cloud: scene, labels }], &TrainOptions::default(), &monitor).unwrap(),
    );
    let other = street(40.0, 7);
    let truth = other.column("Classification").unwrap().values.to_f64();
    let named = classify(&other, &model, &ClassifyParams::default(), &monitor).unwrap();
    let right = named.codes.iter().zip(&truth).filter(|(a, b)| f64::from(**a) == **b).count();
    assert!(right as f64 > 0.97 * truth.len() as f64, "{right} of {}", truth.len());
}

#[test]
fn the_order_of_the_points_does_not_change_their_names() {
    let scene = street(30.0, 3);
    let reversed: Vec<u32> = (0..scene.len() as u32).rev().collect();
    let (model, monitor) = (default_model().unwrap(), Monitor::default());
    let named = classify(&scene, &model, &ClassifyParams::default(), &monitor).unwrap();
    let turned = classify(&scene.select(&reversed), &model, &ClassifyParams::default(), &monitor).unwrap();
    let same = named.codes.iter().zip(turned.codes.iter().rev()).filter(|(a, b)| a == b).count();
    // Equal sums added in a different order may differ in the last bit and change a tie.
    assert!(same as f64 >= 0.999 * scene.len() as f64, "{same} of {}", scene.len());
}

#[test]
fn a_shift_of_five_thousand_kilometres_changes_no_feature() {
    let scene = street(20.0, 4);
    let rows: Vec<[f64; 3]> = (0..scene.len()).map(|i| scene.xyz(i).map(|v| (v * 1024.0).round() / 1024.0)).collect();
    let shifted: Vec<[f64; 3]> = rows.iter().map(|p| [p[0] + 5_000_000.0, p[1] + 5_000_000.0, p[2] + 100.0]).collect();
    let mut set = FeatureSet::default();
    set.pyramid.first_scale = Some(0.5);
    set.pyramid.levels = Some(4);
    let table = |rows: &[[f64; 3]]| {
        let cloud = scansion_core::Cloud::from_rows(rows).unwrap();
        features::table(&cloud, &set, &Monitor::default()).unwrap()
    };
    let (here, there) = (table(&rows), table(&shifted));
    assert!(here.values.iter().zip(&there.values).all(|(a, b)| a.to_bits() == b.to_bits()));
}
