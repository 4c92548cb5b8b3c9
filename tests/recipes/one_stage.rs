//! The recipes `clusters` (Grilli et al. 2021) and `spheres` (Thomas et al. 2018) end to end.

use scansion_core::evaluation::Confusion;
use scansion_core::parallel::Monitor;
use scansion_core::recipes::{
    AnyFitted, AnyRecipe, Classified, ClassifyParams, LabelledCloud, Model, Report, TrainOptions, classify,
};
use scansion_tests::village::village;

fn trained(name: &str, settings: &[&str]) -> (Model, Box<dyn Report>) {
    let recipe = AnyRecipe::named(name).unwrap().with_settings(settings.iter().copied()).unwrap();
    recipe.train(&[1, 6, 7].map(village), &TrainOptions::default(), &Monitor::default()).unwrap()
}

fn classified(scene: &LabelledCloud, model: &Model) -> Classified {
    classify(&scene.cloud, model, &ClassifyParams::default(), &Monitor::default()).unwrap()
}

fn accuracy(scene: &LabelledCloud, found: &Classified) -> f64 {
    Confusion::from_options(&scene.labels.codes, &found.codes).unwrap().scores().overall_accuracy
}

#[test]
fn a_village_is_named_by_what_was_learned_in_others() {
    let scene = village(2);
    for (name, settings, least) in [
        ("clusters", &[][..], 0.93),
        ("clusters", &["set=b", "classifier=gbt"], 0.93),
        ("spheres", &["spheres.scales=5"], 0.93),
        ("spheres", &["spheres.scales=4", "groups.height=true", "groups.clusters=true"], 0.97),
    ] {
        let (model, report) = trained(name, settings);
        assert_eq!(report.classes().len(), 3);
        let found = classified(&scene, &model);
        let right = accuracy(&scene, &found);
        assert!(right > least, "{name} {settings:?}: {right}");
        assert!(found.fit.is_some_and(|fit| fit.beyond < 0.05), "{:?}", found.fit);
        // Read back from its bytes, the model gives the same labels.
        let again = Model::from_bytes(&model.to_bytes().unwrap(), "a.model".as_ref()).unwrap();
        assert_eq!(classified(&scene, &again), found);
    }
}

#[test]
fn ranks_name_places_and_fail_where_descriptors_do_not() {
    let scene = village(2);
    let right = |name, settings: &[&str]| accuracy(&scene, &classified(&scene, &trained(name, settings).0));
    let [ranks, descriptors] = [right("clusters-paper", &["set=a"]), right("clusters", &["set=a"])];
    assert!(descriptors > 0.9 && ranks <= descriptors, "{ranks} {descriptors}");
}

#[test]
fn the_first_radius_of_training_is_that_of_classification() {
    let (model, report) = trained("spheres", &["spheres.scales=3"]);
    let AnyFitted::Spheres(fitted) = &model.fitted else { panic!("another recipe") };
    // 2.5 spacings of 0.5 m.
    let radius = fitted.recipe.spheres.first_radius.unwrap();
    assert!((radius - 1.25).abs() < 0.1 && report.text().contains("first radius"), "{radius}");
}

#[test]
fn the_labels_have_the_same_bytes_for_any_number_of_threads() {
    let scene = village(3);
    for name in ["clusters", "spheres"] {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (model, _) = trained(name, &["forest.trees=9"]);
                (model.to_bytes().unwrap(), classified(&scene, &model))
            })
        };
        assert!(with(1) == with(3), "{name}");
    }
}

#[test]
fn settings_of_other_methods_and_columns_that_are_absent_are_refused() {
    let refused = |name: &str, settings: &[&str]| {
        let recipe = AnyRecipe::named(name).unwrap().with_settings(settings.iter().copied());
        let trained = recipe.and_then(|recipe| {
            recipe.train(&[village(1)], &TrainOptions::default(), &Monitor::default()).map(|(_, report)| report)
        });
        trained.err().unwrap().to_string()
    };
    assert!(refused("spheres", &["features.pyramid.levels=4"]).contains("features"));
    assert!(refused("spheres", &["groups.colour=true"]).contains("Red"));
    assert!(refused("clusters", &["colour=true"]).contains("Red"));
    assert!(refused("clusters", &["regularise.method=auto"]).contains("clusters"));
}
