//! The recipe `airborne` and the built-in model: scenes with known answers, unusual clouds, and the same bytes always.

use scansion_core::cloud::{Cloud, CodeScheme, Column, Values};
use scansion_core::evaluation::Confusion;
use scansion_core::io;
use scansion_core::parallel::Monitor;
use scansion_core::random::stream;
use scansion_core::recipes::{
    self, AnyRecipe, CarTraining, ClassRules, Classified, ClassifyParams, LabelParams, LabelledCloud, Labels, Model,
    Regularise, TrainOptions, classify, read_labels,
};
use scansion_tests::demo_scan;
use std::path::Path;
use std::sync::OnceLock;

/// A small village: sloping ground, houses with walls and ridged roofs, trees; the code of each point.
struct Village {
    cloud: Cloud,
    codes: Vec<u8>,
}

fn village(seed: u64) -> Village {
    let mut s = stream(seed, 77);
    let (mut rows, mut codes, mut returns) = (Vec::new(), Vec::new(), Vec::new());
    let hill = |x: f64, y: f64| 200.0 + 0.05 * x + 0.02 * y;
    let mut add = |p: [f64; 3], code: u8, number: u8| {
        rows.push(p);
        codes.push(code);
        returns.push(number);
    };
    for i in 0..48_000 {
        let (x, y) = (s.uniform() * 120.0, s.uniform() * 120.0);
        let (u, v) = (x % 40.0, y % 40.0);
        let house = (10.0..22.0).contains(&u) && (10.0..20.0).contains(&v);
        let tree = (u - 32.0).hypot(v - 30.0) < 4.0;
        let noise = 0.03 * (s.uniform() - 0.5);
        match (house, tree && i % 3 > 0) {
            (true, _) => add([x, y, hill(x, y) + 8.0 - 0.6 * (v - 15.0).abs() + noise], 6, 1),
            (_, true) => add([x, y, hill(x, y) + 2.0 + 6.0 * s.uniform()], 5, 1 + (i % 2) as u8),
            _ => add([x, y, hill(x, y) + noise], 2, 1),
        }
    }
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("ReturnNumber", Values::U8(returns.clone()))).unwrap();
    cloud.set_column(Column::new("NumberOfReturns", Values::U8(returns))).unwrap();
    Village { cloud, codes }
}

fn labelled(village: Village) -> LabelledCloud {
    let labels = Labels::new(village.codes.into_iter().map(Some).collect(), CodeScheme::Asprs);
    LabelledCloud { cloud: village.cloud, labels }
}

/// Small enough for a test.
const RECIPE: &str = "recipe = \"airborne\"\nrated_voxel = 1.0\n[features.pyramid]\nfirst_scale = 0.5\nlevels = 5\n[training]\nvoxel = 0.5\n\
                      per_copy = 1500\ndensities = [2.0]\n[forest]\ntrees = 12\n[boosting]\nrounds = 20\n";

fn model() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| trained(&AnyRecipe::from_toml(RECIPE).unwrap()))
}

fn trained(recipe: &AnyRecipe) -> Model {
    recipe.train(&[labelled(village(1))], &TrainOptions::default(), &Monitor::default()).unwrap().0
}

fn plain() -> ClassifyParams {
    ClassifyParams { rules: Some(ClassRules::default()), ..ClassifyParams::default() }
}

fn run(cloud: &Cloud, model: &Model, params: &ClassifyParams) -> Classified {
    classify(cloud, model, params, &Monitor::default()).unwrap()
}

fn share(found: &[u8], wanted: impl Fn(usize) -> u8) -> f64 {
    (0..found.len()).filter(|&i| found[i] == wanted(i)).count() as f64 / found.len() as f64
}

/// A flat field, as exact as a scanner on a calm day: nothing tells ground from a flat roof but what is around.
#[test]
fn the_built_in_model_names_a_flat_field_ground() {
    let model = recipes::default_model().unwrap();
    for noise in [0.0, 0.02] {
        let mut s = stream(7, 7);
        let rows: Vec<[f64; 3]> = (0..160_000)
            .map(|_| [s.uniform() * 100.0, s.uniform() * 100.0, 300.0 + noise * (s.uniform() - 0.5)])
            .collect();
        let found = run(&Cloud::from_rows(&rows).unwrap(), &model, &plain());
        let building = share(&found.codes, |_| 6);
        assert!(building <= 0.001 && share(&found.codes, |_| 2) > 0.995, "noise {noise}: {building}");
    }
}

#[test]
fn the_built_in_model_finds_wires_over_a_field() {
    let mut s = stream(9, 5);
    let mut rows: Vec<[f64; 3]> =
        (0..90_000).map(|_| [s.uniform() * 100.0, s.uniform() * 100.0, 50.0 + 0.02 * s.uniform()]).collect();
    let field = rows.len();
    // Three conductors that sag by 2 m, with a point each 0.3 m.
    for wire in 0..3 {
        let y = 40.0 + 6.0 * f64::from(wire);
        rows.extend((0..330).map(|i| 0.3 * f64::from(i)).map(|x| [x, y, 62.0 + 2.0 * (x / 50.0 - 1.0).powi(2)]));
    }
    let cloud = Cloud::from_rows(&rows).unwrap();
    let found = run(&cloud, &recipes::default_model().unwrap(), &ClassifyParams::default()).codes;
    assert!(share(&found[..field], |_| 2) > 0.999);
    assert!(share(&found[field..], |_| 14) > 0.97, "{}", share(&found[field..], |_| 14));
}

/// The cloud with heights that count downwards.
fn upside_down(cloud: &Cloud) -> Cloud {
    let rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i)).map(|[x, y, z]| [x, y, -z]).collect();
    let mut turned = Cloud::from_rows(&rows).unwrap();
    for name in ["ReturnNumber", "NumberOfReturns"] {
        turned.set_column(cloud.column(name).unwrap().clone()).unwrap();
    }
    turned
}

#[test]
fn the_built_in_model_finds_walls_and_roofs_of_the_demo() {
    let mut cloud = io::read(&demo_scan()).unwrap();
    let params = LabelParams { map: recipes::BUILTIN_MAP.parse().unwrap(), ..LabelParams::default() };
    let truth = read_labels(&cloud, &params).unwrap().codes;
    let model = recipes::default_model().unwrap();
    let iou = |cloud: &Cloud| {
        let confusion = Confusion::from_options(&truth, &run(cloud, &model, &plain()).codes).unwrap();
        confusion.scores().labels.iter().map(|class| class.intersection_over_union).collect::<Vec<f64>>()
    };
    assert_eq!(recipes::builtin_misfit(&run(&cloud, &model, &plain())), None);
    let with_returns = iou(&cloud);
    assert!(with_returns.iter().all(|&iou| iou > 0.9), "{with_returns:?}");
    let why = recipes::builtin_misfit(&run(&upside_down(&cloud), &model, &plain())).unwrap();
    assert!(why.contains("heights are upside down"), "{why}");
    for name in ["ReturnNumber", "NumberOfReturns"] {
        cloud.take_column(name);
    }
    let without = iou(&cloud);
    assert!(without.iter().all(|&iou| iou > 0.85), "{without:?}");
}

#[test]
fn a_village_like_the_first_is_named_right_and_its_trees_by_their_height() {
    let Village { cloud, codes } = village(2);
    let found = run(&cloud, model(), &plain());
    assert!(share(&found.codes, |i| codes[i]) > 0.97, "{}", share(&found.codes, |i| codes[i]));
    assert!(found.fit.is_some_and(|fit| fit.outside < 0.2 && fit.beyond < 0.01), "{:?}", found.fit);
    let divided = run(&cloud, model(), &ClassifyParams::default());
    let same = divided.codes.iter().zip(&found.codes).filter(|(a, b)| a == b || **b == 5 && matches!(a, 3 | 4));
    assert!(same.count() as f64 / codes.len() as f64 > 0.999);
    let unsure = ClassRules { abstain: 0.9, ..ClassRules::default() };
    let unsure = run(&cloud, model(), &ClassifyParams { rules: Some(unsure), ..plain() });
    for ((unsure, found), confidence) in unsure.codes.iter().zip(&found.codes).zip(&found.confidence) {
        assert_eq!(*unsure, if *confidence < 0.9 { 1 } else { *found });
    }
}

#[test]
fn every_number_of_threads_trains_and_classifies_the_same_bytes() {
    let Village { cloud, .. } = village(3);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let model = trained(&AnyRecipe::from_toml(RECIPE).unwrap());
            let found = run(&cloud, &model, &ClassifyParams { probabilities: true, ..ClassifyParams::default() });
            (model.to_bytes().unwrap(), found)
        })
    };
    let one = on(1);
    assert!(one == on(3));
    assert_eq!(Model::from_bytes(&one.0, Path::new("again")).unwrap().to_bytes().unwrap(), one.0);
}

#[test]
fn the_presets_name_smaller_villages_right() {
    // A village of a quarter, and of a twentieth, of the size is one of streets, and of rooms.
    for (name, size) in [("mobile", 0.25), ("indoor", 0.05)] {
        let small = |seed: u64| {
            let Village { cloud, codes } = village(seed);
            let rows: Vec<[f64; 3]> = (0..cloud.len()).map(|i| cloud.xyz(i).map(|v| v * size)).collect();
            Village { cloud: Cloud::from_rows(&rows).unwrap(), codes }
        };
        let recipe = AnyRecipe::named(name).unwrap();
        let quick = ["features.pyramid.levels=6", "forest.trees=12", "boosting.rounds=20", "training.per_copy=1500"];
        let recipe = recipe.with_settings(quick).unwrap();
        assert_eq!(recipe.name(), name);
        let (model, _) = recipe.train(&[labelled(small(1))], &TrainOptions::default(), &Monitor::default()).unwrap();
        let model = Model::from_bytes(&model.to_bytes().unwrap(), Path::new("again")).unwrap();
        assert_eq!(model.fitted.recipe().name(), name);
        let Village { cloud, codes } = small(2);
        let found = run(&cloud, &model, &plain());
        let right = share(&found.codes, |i| codes[i]);
        assert!(right > 0.95, "{name}: {right}");
    }
}

#[test]
fn one_point_a_voxel_is_enough_for_the_first_stage() {
    let Village { cloud, codes } = village(2);
    let every = trained(&AnyRecipe::from_toml(RECIPE).unwrap().with_settings(["rated_voxel=0"]).unwrap());
    let [all, few] = [&every, model()].map(|model| run(&cloud, model, &plain()));
    let [all, few] = [all, few].map(|found| share(&found.codes, |i| codes[i]));
    assert!((all - few).abs() < 0.01, "{all} {few}");
}

#[test]
fn clouds_without_ground_of_three_points_or_of_one_place_get_an_answer() {
    let mut s = stream(5, 1);
    let crown: Vec<[f64; 3]> = (0..3000).map(|_| [s.uniform() * 5.0, s.uniform() * 5.0, s.uniform() * 8.0]).collect();
    let cliff: Vec<[f64; 3]> = (0..3000).map(|_| [0.1 * s.uniform(), s.uniform() * 40.0, s.uniform() * 60.0]).collect();
    let normalised: Vec<[f64; 3]> = {
        let hilly = village(4).cloud;
        let level = |p: [f64; 3]| [p[0], p[1], p[2] - 200.0 - 0.05 * p[0] - 0.02 * p[1]];
        (0..hilly.len()).map(|i| level(hilly.xyz(i))).collect()
    };
    let few = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 5.0]];
    for rows in [crown, cliff, normalised, few, vec![[4.0; 3]; 500], vec![[f64::NAN; 3]; 4]] {
        let found = run(&Cloud::from_rows(&rows).unwrap(), model(), &ClassifyParams::default());
        assert_eq!(found.codes.len(), rows.len());
        assert!(found.codes.iter().all(|code| [1, 2, 3, 4, 5, 6, 7, 18].contains(code)));
        assert!(found.confidence.iter().all(|c| (0.0..=1.0).contains(c)));
    }
}

#[test]
fn a_cloud_beyond_the_training_is_warned_of() {
    let mut s = stream(6, 1);
    let rows: Vec<[f64; 3]> = (0..20_000).map(|_| [(); 3].map(|()| s.uniform() * 80.0)).collect();
    let noise = Cloud::from_rows(&rows).unwrap();
    for model in [model(), &recipes::default_model().unwrap()] {
        let found = run(&noise, model, &plain());
        assert!(found.fit.is_some_and(|fit| fit.beyond > 0.05), "{:?}", found.fit);
        assert!(
            found.warnings.iter().any(|text| text.contains("beyond all of those in training")),
            "{:?}",
            found.warnings
        );
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let wrong = |setting: &str| {
        let recipe = AnyRecipe::named("airborne").unwrap().with_settings([setting]).unwrap();
        recipe.validate().unwrap_err().to_string()
    };
    for (setting, name) in [
        ("folds.square=0", "folds.square"),
        ("folds.missing=2", "folds.missing"),
        ("forest.trees=1", "trees"),
        ("classes.vegetation=[2.0, 1.0]", "classes.vegetation"),
        ("context.cells=[0.0]", "context.cells"),
        ("features.profile.voxel=-1.0", "profile.voxel"),
    ] {
        assert!(wrong(setting).contains(name), "{setting}: {}", wrong(setting));
    }
    let large = AnyRecipe::from_toml(&format!("{RECIPE}[folds]\nsquare = 1e6\n")).unwrap();
    let message = large.train(&[labelled(village(1))], &TrainOptions::default(), &Monitor::default()).err().unwrap();
    assert!(message.to_string().contains("folds.square"), "{message}");
}

/// The code of cars in the labels of a test.
const CAR: u8 = 64;

/// The village with a car in each of its nine yards, in places that depend on the seed.
fn parked(seed: u64) -> Village {
    let Village { cloud, mut codes } = village(seed);
    let mut s = stream(seed, 78);
    let places: Vec<[f64; 2]> = (0..9).map(|_| [2.0 + 4.0 * s.uniform(), 24.0 + 3.0 * s.uniform()]).collect();
    let rows: Vec<[f64; 3]> = (0..cloud.len())
        .map(|i| {
            let [x, y, z] = cloud.xyz(i);
            let [u, v] = places[(x / 40.0) as usize * 3 + (y / 40.0) as usize];
            let (along, across) = (x % 40.0 - u, y % 40.0 - v);
            if codes[i] != 2 || !(0.0..4.5).contains(&along) || !(0.0..1.8).contains(&across) {
                return [x, y, z];
            }
            codes[i] = CAR;
            // Bonnet, roof and boot.
            [x, y, z + if (1.2..3.8).contains(&along) { 1.5 } else { 0.9 }]
        })
        .collect();
    let mut moved = Cloud::from_rows(&rows).unwrap();
    cloud.columns().iter().for_each(|column| moved.set_column(column.clone()).unwrap());
    Village { cloud: moved, codes }
}

/// A model that takes cars for vegetation.
fn before_cars() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| {
        let clouds = [1, 2].map(|seed| {
            let Village { cloud, codes } = parked(seed);
            let codes = codes.into_iter().map(|code| if code == CAR { 5 } else { code }).collect();
            labelled(Village { cloud, codes })
        });
        let recipe = AnyRecipe::from_toml(RECIPE).unwrap();
        recipe.train(&clouds, &TrainOptions::default(), &Monitor::default()).unwrap().0
    })
}

fn with_cars() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| {
        let clouds = [labelled(parked(1)), labelled(parked(2))];
        let training = CarTraining { code: CAR, ..CarTraining::default() };
        let (model, report) = before_cars().with_cars(&clouds, &training, &Monitor::default()).unwrap();
        assert!(report.points > 400 && report.cars > 100 && report.others > 200, "{report:?}");
        model
    })
}

#[test]
fn cars_become_unclassified_and_nothing_else_changes() {
    let Village { cloud, codes } = parked(3);
    let before = run(&cloud, before_cars(), &ClassifyParams::default());
    let after = run(&cloud, with_cars(), &ClassifyParams::default());
    assert!(before.cars.is_empty() && after.cars.len() == cloud.len());
    assert_eq!((&before.confidence, &before.entropy), (&after.confidence, &after.entropy));
    let changed: Vec<usize> = (0..cloud.len()).filter(|&i| before.codes[i] != after.codes[i]).collect();
    assert!(changed.iter().all(|&i| after.codes[i] == 1 && (3..=6).contains(&before.codes[i])));
    let right = changed.iter().filter(|&&i| codes[i] == CAR).count();
    let taken = (0..codes.len()).filter(|&i| codes[i] == CAR && (3..=6).contains(&before.codes[i])).count();
    assert!(right * 5 > taken * 2, "{right} found of {taken} that are taken for vegetation or buildings");
    assert!(right * 10 > changed.len() * 8, "{right} right of {}", changed.len());
    // Where there are no cars, and where they are not looked for.
    let none = village(4).cloud;
    assert_eq!(
        run(&none, before_cars(), &ClassifyParams::default()).codes,
        run(&none, with_cars(), &ClassifyParams::default()).codes
    );
    assert_eq!(run(&cloud, with_cars(), &plain()).codes, run(&cloud, before_cars(), &plain()).codes);
}

#[test]
fn cars_are_the_same_with_a_regularisation_any_threads_and_after_writing() {
    let cloud = parked(3).cloud;
    let params = ClassifyParams { regularise: Some(Regularise::Local), ..ClassifyParams::default() };
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let read = Model::from_bytes(&with_cars().to_bytes().unwrap(), Path::new("cars.model")).unwrap();
    assert_eq!(&read, with_cars());
    let [many, single] = [run(&cloud, with_cars(), &params), one.install(|| run(&cloud, &read, &params))];
    assert_eq!((&many.codes, &many.cars), (&single.codes, &single.cars));
    assert_eq!(many.cars, run(&cloud, with_cars(), &plain()).cars);
    let again = {
        let clouds = [labelled(parked(1)), labelled(parked(2))];
        let training = CarTraining { code: CAR, ..CarTraining::default() };
        one.install(|| before_cars().with_cars(&clouds, &training, &Monitor::default()).unwrap().0)
    };
    assert_eq!(&again, with_cars());
}

#[test]
fn models_that_cannot_learn_cars_say_so() {
    let training = CarTraining { code: CAR, ..CarTraining::default() };
    let refused = |model: &Model, clouds: &[LabelledCloud]| {
        model.with_cars(clouds, &training, &Monitor::default()).unwrap_err().to_string()
    };
    let none = refused(model(), &[labelled(village(1))]);
    assert!(none.contains("0 samples of cars (code 64)"), "{none}");
    let flat =
        AnyRecipe::from_toml(&RECIPE.replace("[features.pyramid]", "[features]\nheight = false\n[features.pyramid]"));
    let without = refused(&trained(&flat.unwrap()), &[labelled(parked(1))]);
    assert!(without.contains("heights above the ground"), "{without}");
    let pyramid =
        AnyRecipe::from_toml("[features.pyramid]\nfirst_scale = 0.5\nlevels = 2\n[forest]\ntrees = 2\n").unwrap();
    let other = refused(&trained(&pyramid), &[labelled(parked(1))]);
    assert!(other.contains("pyramid cannot learn cars"), "{other}");
}
