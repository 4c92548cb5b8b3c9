//! The recipe of Hasanpour Zaryabi et al. 2022 end to end, and all segmentation methods.

use scansion_core::cloud::Cloud;
use scansion_core::evaluation::Confusion;
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{
    AnyRecipe, ClassifyParams, LabelledCloud, Model, ObjectsRecipe, SegmentMethod, SegmentParams, System, TrainOptions,
    TrainingResult, classify, segment,
};
use scansion_tests::village::{labelled, village};

fn objects(settings: &[&str]) -> ObjectsRecipe {
    match AnyRecipe::named("objects").unwrap().with_settings(settings.iter().copied()).unwrap() {
        AnyRecipe::Objects(recipe) => *recipe,
        _ => unreachable!("the objects recipe was asked for"),
    }
}

const SIZE: &str = "segments.slic.size=2";

#[test]
fn a_village_is_named_by_the_segments_of_others() {
    let monitor = Monitor::default();
    let LabelledCloud { cloud: other, labels: truth } = village(2);
    for classifier in ["rf", "gbt", "bagging", "linear"] {
        let kind = format!("classifier={classifier}");
        // Each village has one large ground segment, so that a single village would not show the variation.
        let others = [1, 6, 7, 8, 9].map(village);
        let settings = [SIZE, &kind, "training.share=1.0", "boosting.min_samples_leaf=3"];
        let TrainingResult { fitted, trained, report } =
            objects(&settings).train(&others, &TrainOptions::default(), &monitor).unwrap();
        let model = Model { fitted: fitted.into(), trained };
        assert!(report.by_segment.is_none() && report.oracle_accuracy > 0.97, "{report:?}");
        let found = classify(&other, &model, &ClassifyParams::default(), &monitor).unwrap();
        let scores = Confusion::from_options(&truth.codes, &found.codes).unwrap().scores();
        assert!(scores.overall_accuracy > 0.9, "{classifier}: {}", scores.overall_accuracy);
    }
}

/// Feet in a cloud that does not say so: the density is that of the recipe's unit in training and classification.
#[test]
fn a_unit_of_the_recipe_counts_for_the_density_too() {
    let feet = |seed| {
        let LabelledCloud { cloud, labels } = village(seed);
        let rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i).map(|v| v / 0.3048)).collect();
        LabelledCloud { cloud: Cloud::from_rows(&rows).unwrap(), labels }
    };
    let (recipe, monitor) = (objects(&[SIZE, "metres_per_unit=0.3048"]), Monitor::default());
    let model = Model::from(recipe.train(&[feet(1), feet(2)], &TrainOptions::default(), &monitor).unwrap());
    assert!((3.5..4.5).contains(&model.trained.fingerprint.density), "{}", model.trained.fingerprint.density);
    let found = classify(&feet(3).cloud, &model, &ClassifyParams::default(), &monitor).unwrap();
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
}

#[test]
fn a_class_that_is_too_rare_to_be_learned_is_named() {
    let LabelledCloud { cloud, mut labels } = village(1);
    labels.codes.fill(Some(2));
    labels.codes[0] = Some(6);
    let clouds = [LabelledCloud { cloud, labels }];
    let message =
        objects(&[SIZE]).train(&clouds, &TrainOptions::default(), &Monitor::default()).unwrap_err().to_string();
    assert!(message.contains("only one class to learn, code 2"), "{message}");
    assert!(message.contains("is left out: its 1 points are the majority of no segment"), "{message}");
}

#[test]
fn segments_that_are_not_learned_from_are_scored() {
    let recipe = objects(&[SIZE, "training.share=0.5"]);
    let report = recipe.train(&[village(1), village(2)], &TrainOptions::default(), &Monitor::default()).unwrap().report;
    assert!(report.learned < report.labelled);
    let (by_segment, by_point) = (report.by_segment.unwrap(), report.by_point.unwrap());
    assert_eq!(by_segment.points as usize, report.labelled - report.learned);
    assert!(by_point.points > by_segment.points && by_segment.overall_accuracy > 0.8, "{by_segment:?}");
}

#[test]
fn squares_that_are_learned_from_and_purity_reach_the_report() {
    let monitor = Monitor::default();
    let settings = [SIZE, "training.disjoint=true", "training.square=15", "training.purity=0.9"];
    let report = objects(&settings).train(&[village(1)], &TrainOptions::default(), &monitor).unwrap().report;
    let share = report.learned as f64 / report.labelled as f64;
    assert!((0.25..0.45).contains(&share), "{share}");
    assert!(report.labelled < report.segments, "impure segments have no class");
    let all =
        objects(&[SIZE, "training.share=1.0"]).train(&[village(1)], &TrainOptions::default(), &monitor).unwrap().report;
    assert!(all.by_segment.is_none() && all.learned == all.labelled);
}

#[test]
fn models_and_segments_are_the_same_for_1_2_3_and_8_threads() {
    let LabelledCloud { cloud, labels } = village(3);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let monitor = Monitor::default();
            let model = Model::from(
                objects(&[SIZE])
                    .train(
                        &[LabelledCloud { cloud: cloud.clone(), labels: labels.clone() }],
                        &TrainOptions::default(),
                        &monitor,
                    )
                    .unwrap(),
            );
            let found = classify(&cloud, &model, &ClassifyParams::default(), &monitor).unwrap();
            let parted: Vec<_> = SegmentMethod::ALL
                .iter()
                .map(|&method| {
                    let params = SegmentParams { method, ..SegmentParams::default() };
                    segment(&cloud, Some(&labels), &params, &monitor).unwrap().clusters
                })
                .collect();
            (model.to_bytes().unwrap(), found, parted)
        })
    };
    let expected = run(1);
    for threads in [2, 3, 8] {
        assert!(run(threads) == expected, "{threads} threads");
    }
}

#[test]
fn every_method_parts_the_village_well() {
    let LabelledCloud { cloud, labels } = village(4);
    for &method in SegmentMethod::ALL {
        let mut params = SegmentParams { method, ..SegmentParams::default() };
        if let Ok(sized) = params.clone().with_size(2.0) {
            params = sized;
        }
        let found = segment(&cloud, Some(&labels), &params, &Monitor::default()).unwrap();
        let oracle = found.report.oracle_accuracy.unwrap();
        println!("{}: {} segments, {oracle:.4}", method.name(), found.report.segments);
        assert!(found.clusters.iter().all(|&c| c > 0));
        assert_eq!(*found.clusters.iter().max().unwrap() as usize, found.report.segments);
        assert!(found.report.segments < cloud.len() / 4, "{}: {}", method.name(), found.report.segments);
        assert!(oracle > 0.9, "{}: {oracle}", method.name());
    }
}

#[test]
fn levels_are_parted_too() {
    let LabelledCloud { cloud, labels } = village(5);
    let params = SegmentParams { method: SegmentMethod::Riemannian, levels: vec![4, 5], ..SegmentParams::default() };
    let found = segment(&cloud, Some(&labels), &params, &Monitor::default()).unwrap();
    assert_eq!((found.levels.len(), found.report.levels.len()), (2, 2));
    let [coarse, fine] = &found.report.levels[..] else { unreachable!() };
    assert!(coarse.min_depth == 4 && coarse.supervoxels < fine.supervoxels);
    assert_eq!(*found.levels[1].iter().max().unwrap() as usize, fine.segments);
}

#[test]
fn odd_clouds_are_parted_or_refused_but_never_break() {
    let plane: Vec<[f64; 3]> = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 0.0]).collect();
    let mut holes = plane.clone();
    holes[11] = [f64::NAN; 3];
    let far: Vec<[f64; 3]> = plane.iter().copied().chain(plane.iter().map(|p| [p[0] + 5e4, p[1], p[2]])).collect();
    let clouds: [&[[f64; 3]]; 6] =
        [&[[1.0, 2.0, 3.0]], &[[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]], &[[5.0; 3]; 30], &plane, &holes, &far];
    for (rows, method) in clouds.iter().flat_map(|&rows| SegmentMethod::ALL.iter().map(move |&method| (rows, method))) {
        let cloud = Cloud::from_rows(rows).unwrap();
        let params = SegmentParams { method, ..SegmentParams::default() };
        let found = segment(&cloud, None, &params, &Monitor::default());
        let clusters = found.unwrap_or_else(|e| panic!("{} on {} points: {e}", method.name(), rows.len())).clusters;
        let finite = rows.iter().map(|p| p[0].is_finite());
        assert!(clusters.iter().zip(finite).all(|(&c, finite)| (c > 0) == finite), "{}", method.name());
    }
    let train = |rows: &[[f64; 3]], codes: &[u8], settings: &[&str]| {
        objects(settings)
            .train(&[labelled(rows, codes)], &TrainOptions::default(), &Monitor::default())
            .map_err(|e| e.to_string())
    };
    assert!(train(&plane, &[0; 400], &[]).unwrap_err().contains("no labelled point"));
    let halves: Vec<u8> = (0..400).map(|i| if i < 200 { 2 } else { 6 }).collect();
    assert!(train(&plane, &halves, &["segments.colour=true"]).unwrap_err().contains("Red"));
    assert!(train(&holes, &[2; 400], &[SIZE]).unwrap_err().contains("only one class"));
    let roof = plane.iter().map(|p| [p[0] + 40.0, p[1], 10.0]);
    let two: Vec<[f64; 3]> = holes.iter().copied().chain(roof).collect();
    let codes: Vec<u8> = (0..800).map(|i| if i < 400 { 2 } else { 6 }).collect();
    let model = Model::from(train(&two, &codes, &[SIZE]).unwrap());
    let cloud = Cloud::from_rows(&two).unwrap();
    let codes = classify(&cloud, &model, &ClassifyParams::default(), &Monitor::default()).unwrap().codes;
    assert!(codes[11] == 1 && codes[12] != 1, "points that are not finite stay unclassified");
}
