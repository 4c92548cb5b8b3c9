//! The choice of a method of regularisation in training: a field where neighbours know better, none where they do not.

use scansion_core::classification::ForestParams;
use scansion_core::cloud::{Cloud, CodeScheme, Column, Values};
use scansion_core::features::{FeatureSet, PyramidParams};
use scansion_core::parallel::Monitor;
use scansion_core::random::{Stream, stream};
use scansion_core::recipes::{
    AnyRecipe, ChoiceReport, ClassifyParams, LabelledCloud, Labels, Model, PyramidRecipe, Regularise, RegulariseParams,
    System, TrainOptions, TrainingResult, classify,
};

/// A plain of 50 m; `of` gives class and intensity of a place.
fn plain(side: usize, mut of: impl FnMut([f64; 2], &mut Stream) -> (u8, u16)) -> LabelledCloud {
    let mut random = stream(7, side as u64);
    let (mut rows, mut codes, mut intensity) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..side * side {
        let at = [(i % side) as f64, (i / side) as f64].map(|v| 0.4 * v + 0.1 * random.uniform());
        rows.push([at[0], at[1], 0.02 * random.uniform()]);
        let (code, value) = of(at, &mut random);
        codes.push(Some(code));
        intensity.push(value);
    }
    let mut cloud = Cloud::from_rows(&rows).unwrap();
    cloud.set_column(Column::new("Intensity", Values::U16(intensity))).unwrap();
    LabelledCloud { cloud, labels: Labels::new(codes, CodeScheme::Asprs) }
}

fn recipe() -> PyramidRecipe {
    PyramidRecipe {
        features: FeatureSet {
            intensity: true,
            pyramid: PyramidParams { first_scale: Some(0.4), levels: Some(1), ..PyramidParams::default() },
            ..FeatureSet::default()
        },
        forest: ForestParams { trees: 12, min_samples_leaf: 20, ..ForestParams::default() },
        ..PyramidRecipe::default()
    }
}

fn trained(cloud: LabelledCloud) -> (Model, ChoiceReport) {
    let TrainingResult { fitted, trained, report } =
        recipe().train(&[cloud], &TrainOptions::default(), &Monitor::default()).unwrap();
    let model = Model { fitted: fitted.into(), trained };
    (model, report.regularisation.unwrap())
}

/// Fields of 7 m whose intensities overlap.
fn fields(side: usize) -> LabelledCloud {
    plain(side, |[x, y], random| {
        let wood = ((x / 7.0) as usize + (y / 7.0) as usize) % 2 == 1;
        (if wood { 5 } else { 2 }, (100.0 * random.uniform() + if wood { 40.0 } else { 0.0 }) as u16)
    })
}

#[test]
fn a_field_is_chosen_where_neighbours_know_better_and_the_model_uses_it() {
    let (model, choice) = trained(fields(120));
    assert!(matches!(choice.method, Regularise::PointCrf | Regularise::SegmentCrf | Regularise::Local), "{choice:?}");
    let best = choice.candidates.iter().find(|c| (c.method, c.strength) == (choice.method, choice.strength)).unwrap();
    assert!(best.gain > 0.1 && best.gain > best.standard_error && best.largest_loss == 0.0, "{choice:?}");
    let RegulariseParams { method, .. } = model.fitted.regularise();
    assert_eq!(*method, choice.method);
    // The recipe of the model names it, and a method that the user asks for goes first.
    let model = Model::from_bytes(&model.to_bytes().unwrap(), "a.model".as_ref()).unwrap();
    assert!(model.fitted.recipe().to_toml().unwrap().contains(&format!("method = \"{}\"", choice.method.name())));
    let scene = fields(90);
    let wrong = |regularise| {
        let params = ClassifyParams { regularise, ..ClassifyParams::default() };
        let named = classify(&scene.cloud, &model, &params, &Monitor::default()).unwrap();
        named.codes.iter().zip(&scene.labels.codes).filter(|(code, truth)| Some(**code) != **truth).count()
    };
    let (own, none) = (wrong(None), wrong(Some(Regularise::None)));
    assert!(2 * own < none, "{own} of {none}");
}

#[test]
fn none_is_chosen_where_neighbours_know_nothing() {
    let (model, choice) = trained(plain(100, |_, random| {
        let wood = random.below(2) == 1;
        (if wood { 5 } else { 2 }, (60.0 * random.uniform() + if wood { 50.0 } else { 0.0 }) as u16)
    }));
    assert_eq!(choice.method, Regularise::None, "{choice:?}");
    assert_eq!(model.fitted.regularise().method, Regularise::None);
    assert!(choice.candidates.len() > 5 && choice.patches > 2, "{choice:?}");
}

#[test]
fn a_scene_of_a_few_metres_is_divided_too_and_one_without_two_classes_in_both_colours_gets_none() {
    let (_, small) = trained(fields(40));
    assert!(small.patches > 2 && small.points > 1000, "{small:?}");
    let (model, tiny) = trained(plain(12, |[x, y], _| if x < 1.0 && y < 1.0 { (5, 90) } else { (2, 10) }));
    assert!(tiny.candidates.is_empty() && tiny.text().contains("too few"), "{tiny:?}");
    assert_eq!(model.fitted.regularise().method, Regularise::None);
}

#[test]
fn a_method_that_the_recipe_names_is_not_chosen_again_and_a_section_without_one_is() {
    let named = PyramidRecipe { regularise: RegulariseParams::default(), ..recipe() };
    let TrainingResult { fitted, trained, report } =
        named.train(&[fields(40)], &TrainOptions::default(), &Monitor::default()).unwrap();
    let model = Model { fitted: fitted.into(), trained };
    assert!(report.regularisation.is_none() && model.fitted.regularise().method == Regularise::None);
    let read = |text: &str| AnyRecipe::from_toml(text).map(|recipe| recipe.to_toml().unwrap());
    for name in ["pyramid", "airborne"] {
        let text = read(&format!("recipe = \"{name}\"\n[regularise]\nneighbours = 8\n")).unwrap();
        assert!(text.contains("method = \"auto\"") && text.contains("neighbours = 8"), "{text}");
    }
    let weak = AnyRecipe::from_toml("recipe = \"weak\"\n[regularise]\nmethod = \"auto\"\n").unwrap();
    assert!(weak.validate().unwrap_err().to_string().contains("does not choose"));
    let wrong = read("[regularise]\nneighbors = 8\n").unwrap_err().to_string();
    assert!(wrong.contains("did you mean `neighbours`"), "{wrong}");
}
