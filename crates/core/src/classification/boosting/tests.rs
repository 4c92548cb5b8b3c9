//! Boosting as a whole, compared with brute force, closed forms and itself.

use super::super::{ClassWeight, Samples};
use super::*;
use crate::classification::Predictor;
use crate::classification::nodes::LEAF_CUT;
use crate::classification::testing::{Owned, blobs};
use crate::parallel::Monitor;
use crate::random::stream;

fn fit(samples: &Samples<'_>, params: &BoostingParams) -> (Boosting, BoostingReport) {
    Boosting::fit_with_report(samples, None, params, &Monitor::default()).unwrap()
}

fn probabilities(model: &Boosting, rows: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; rows.len() / model.width() * model.classes()];
    model.predict_proba(rows, &mut out).unwrap();
    out
}

fn quick() -> BoostingParams {
    BoostingParams { rounds: 12, max_leaves: 15, min_samples_leaf: 5, ..BoostingParams::default() }
}

/// Every third value of the even features is missing.
fn with_gaps(mut data: Owned) -> Owned {
    let width = data.width;
    data.features
        .iter_mut()
        .enumerate()
        .filter(|(i, _)| (i % width).is_multiple_of(2) && i % 3 == 0)
        .for_each(|(_, v)| *v = f32::NAN);
    data
}

#[test]
fn the_training_loss_falls_every_round_and_is_that_of_the_probabilities() {
    for classes in [2, 3, 5] {
        let data = blobs(3000, 8, classes, 0.0);
        let (model, report) = fit(&data.samples(), &BoostingParams { rounds: 40, ..quick() });
        assert!(report.training_loss.windows(2).all(|w| w[1] < w[0]), "{:?}", report.training_loss);
        let rows = probabilities(&model, &data.features);
        let own = rows.chunks(classes).zip(&data.labels).map(|(row, &l)| -f64::from(row[usize::from(l)]).ln());
        let loss = own.sum::<f64>() / 3000.0;
        assert!((loss - report.training_loss[40]).abs() < 1e-5, "{loss}");
    }
}

/// Gain and cut of the best split by trying all of them, with NaN on either side, from the definition of the gain.
fn brute_force(x: &[f32], derivatives: &[(f64, f64)], (lambda, least): (f64, usize)) -> (f64, f32, bool) {
    let score = |side: &dyn Fn(f32) -> bool| {
        let rows = x.iter().zip(derivatives).filter(|(x, _)| side(**x));
        let (g, h, n) = rows.fold((0.0, 0.0, 0), |(g, h, n), (_, d)| (g + d.0, h + d.1, n + 1));
        (g * g / (h + lambda), n, h)
    };
    let (all, count, hessian) = score(&|_| true);
    let share = (least as f64 - 0.5) / count as f64;
    let mut best = (0.0, 0.0, false);
    for &cut in x.iter().filter(|c| !c.is_nan()) {
        for right in [false, true] {
            let goes_right = |x: f32| if x.is_nan() { right } else { x > cut };
            let (l, r) = (score(&|x| !goes_right(x)), score(&goes_right));
            let gain = l.0 + r.0 - all;
            let allowed = l.1.min(r.1) >= least && l.2.min(r.2) >= share * hessian;
            if allowed && gain > best.0 + 1e-12 {
                best = (gain, cut, right);
            }
        }
    }
    best
}

#[test]
fn a_tree_of_one_split_is_the_best_of_all_splits() {
    for trial in 0..40 {
        let mut random = stream(trial, 0);
        let n = 120;
        let x: Vec<f32> =
            (0..n).map(|_| if random.below(6) == 0 { f32::NAN } else { random.below(25) as f32 }).collect();
        let labels: Vec<u16> =
            x.iter().map(|v| u16::from(random.uniform() < if *v > 12.0 || v.is_nan() { 0.7 } else { 0.3 })).collect();
        // There are enough samples above 21, but their weight is too small for a child.
        let weigh = |v: &f32| if *v > 21.0 { 0.02 } else { 0.5 + random.below(3) as f32 };
        let weights: Vec<f32> = x.iter().map(weigh).collect();
        let samples = Samples { features: &x, width: 1, labels: &labels, weights: Some(&weights), classes: 2 };
        let params = BoostingParams { rounds: 1, max_leaves: 2, min_samples_leaf: 4, lambda: 0.7, ..quick() };
        let (model, _) = fit(&samples, &params);

        let sum =
            |class| labels.iter().zip(&weights).filter(|(l, _)| **l == class).map(|(_, w)| f64::from(*w)).sum::<f64>();
        let p = sum(1) / (sum(0) + sum(1));
        let of = |(l, w): (&u16, &f32)| (f64::from(*w) * (p - f64::from(*l)), f64::from(*w) * p * (1.0 - p));
        let derivatives: Vec<(f64, f64)> = labels.iter().zip(&weights).map(of).collect();
        let (gain, cut, missing_right) = brute_force(&x, &derivatives, (0.7, 4));
        if gain <= 0.0 {
            assert_eq!(model.nodes(), 1);
            continue;
        }
        let right = |x: f32| if x.is_nan() { missing_right } else { x > cut };
        for side in [false, true] {
            let own = x.iter().zip(&derivatives).filter(|(x, _)| right(**x) == side);
            let (g, h) = own.fold((0.0, 0.0), |(g, h), (_, d)| (g + d.0, h + d.1));
            let score = (p / (1.0 - p)).ln() - 0.1 * g / (h + 0.7);
            let wanted = 1.0 / (1.0 + (-score).exp());
            for &value in x.iter().filter(|x| right(**x) == side) {
                let found = f64::from(probabilities(&model, &[value])[1]);
                assert!((found - wanted).abs() < 1e-6, "trial {trial} value {value}: {found} {wanted}");
            }
        }
    }
}

#[test]
fn missing_values_go_where_they_resemble() {
    for wanted in [0u16, 1] {
        let x: Vec<f32> = (0..300).map(|i| if i % 3 == 0 { f32::NAN } else { i as f32 }).collect();
        let labels: Vec<u16> = x.iter().map(|v| if v.is_nan() { wanted } else { u16::from(*v > 150.0) }).collect();
        let samples = Samples { features: &x, width: 1, labels: &labels, weights: None, classes: 2 };
        let (model, _) = fit(&samples, &BoostingParams { rounds: 30, max_leaves: 2, ..quick() });
        assert_eq!(model.predict(&[f32::NAN, 20.0, 280.0]).unwrap(), [wanted, 0, 1]);
        assert_eq!(model.twins.len(), usize::from(wanted == 1));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_model() {
    let data = with_gaps(blobs(4000, 19, 4, 0.0));
    let params = BoostingParams { row_fraction: 0.7, column_fraction: 0.5, early_stopping: 5, ..quick() };
    let with = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| fit(&data.samples(), &params))
    };
    let (one, three) = (with(1), with(3));
    assert!(one == three);
    let other = fit(&data.samples(), &BoostingParams { seed: 1, ..params });
    assert!(one.0 != other.0);
}

/// Probabilities by the definition: row by row, node by node.
fn slowly(model: &Boosting, row: &[f32]) -> Vec<f32> {
    let mut scores = model.start.clone();
    let groups = scores.len();
    for (tree, &root) in model.roots.iter().enumerate() {
        let mut at = root as usize;
        while model.nodes[at].cut != LEAF_CUT {
            let (node, width) = (model.nodes[at], model.width);
            let column = usize::from(node.feature);
            let x = row[if column < width { column } else { usize::from(model.twins[column - width]) }];
            let right =
                if x.is_nan() { column >= width } else { x > model.binning.cuts(column)[usize::from(node.cut)] };
            at = node.left as usize + usize::from(right);
        }
        scores[tree % groups] += model.leaf_values[at];
    }
    let e: Vec<f32> = scores.iter().map(|s| s.exp()).collect();
    e.iter().map(|v| v / e.iter().sum::<f32>()).collect()
}

#[test]
fn prediction_in_tiles_and_by_the_walk_agrees_with_single_rows() {
    let data = with_gaps(blobs(3000, 11, 3, 0.0));
    for max_leaves in [15, 300] {
        let params = BoostingParams { max_leaves, min_samples_leaf: 2, ..quick() };
        let (model, _) = fit(&data.samples(), &params);
        assert!(!model.twins.is_empty() && (model.nodes() / model.trees() > 256) == (max_leaves > 128));
        let all = probabilities(&model, &data.features);
        for (row, found) in data.features.chunks(11).zip(all.chunks(3)).step_by(7) {
            assert!(slowly(&model, row).iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-6));
            assert_eq!(probabilities(&model, row), found);
        }
        let (small, kept) = model.clone().retain_used();
        let rows: Vec<f32> = data.features.chunks(11).flat_map(|r| kept.iter().map(|&f| r[f])).collect();
        assert_eq!(probabilities(&small, &rows), all);
    }
}

#[test]
fn early_stopping_keeps_the_round_of_the_lowest_validation_loss() {
    let data = blobs(600, 6, 3, 0.0);
    let held = blobs(1200, 6, 3, 0.0);
    let held = Samples { features: &held.features[600 * 6..], labels: &held.labels[600..], ..held.samples() };
    let params = BoostingParams { rounds: 300, early_stopping: 10, learning_rate: 0.3, ..quick() };
    let (model, report) =
        Boosting::fit_with_report(&data.samples(), Some(&held), &params, &Monitor::default()).unwrap();
    let lowest = (0..report.validation_loss.len())
        .min_by(|&a, &b| report.validation_loss[a].total_cmp(&report.validation_loss[b]));
    assert_eq!(Some(report.rounds), lowest);
    assert!(report.rounds < 300 && report.validation_loss.len() == report.rounds + 11);
    assert_eq!(model.trees(), 3 * report.rounds);
    let rows = probabilities(&model, held.features);
    let own = rows.chunks(3).zip(held.labels).map(|(row, &l)| -f64::from(row[usize::from(l)]).ln());
    assert!((own.sum::<f64>() / 600.0 - report.validation_loss[report.rounds]).abs() < 1e-5);
    let (_, own) = fit(&data.samples(), &params);
    assert!(own.rounds < 300 && own.validation_loss.len() == own.rounds + 11);
}

#[test]
fn classes_without_samples_get_probability_0() {
    let mut data = blobs(400, 4, 3, 0.0);
    data.labels.iter_mut().for_each(|l| *l = if *l == 1 { 4 } else { 2 * *l });
    data.classes = 6;
    let (model, _) = fit(&data.samples(), &quick());
    let rows = probabilities(&model, &data.features);
    assert!(
        rows.chunks(6).all(|r| r[1] == 0.0 && r[3] == 0.0 && r[5] == 0.0 && (r.iter().sum::<f32>() - 1.0).abs() < 1e-5)
    );
    data.labels.fill(3);
    let (model, report) = fit(&data.samples(), &quick());
    assert_eq!(model.predict(&data.features[..8]).unwrap(), [3, 3]);
    assert_eq!((model.trees(), report.training_loss[0]), (0, 0.0));
}

#[test]
fn samples_of_weight_0_are_as_if_they_were_absent() {
    let data = blobs(500, 5, 3, 0.0);
    let weights: Vec<f32> = (0..500).map(|i| f32::from(u8::from(i < 300))).collect();
    let (model, _) = fit(&Samples { weights: Some(&weights), ..data.samples() }, &quick());
    let few = Samples { features: &data.features[..1500], labels: &data.labels[..300], ..data.samples() };
    assert!(model == fit(&few, &quick()).0);
}

#[test]
fn class_weights_are_weights_of_their_samples() {
    let data = blobs(500, 5, 3, 0.0);
    let weights: Vec<f32> = data.labels.iter().map(|&l| [1.0, 2.0, 0.5][usize::from(l)]).collect();
    let by_sample = fit(&Samples { weights: Some(&weights), ..data.samples() }, &quick());
    let params = BoostingParams { class_weight: ClassWeight::PerClass(vec![1.0, 2.0, 0.5]), ..quick() };
    assert!(by_sample == fit(&data.samples(), &params));
}

#[test]
fn weights_whose_products_vanish_are_refused() {
    let data = blobs(100, 4, 2, 0.0);
    let weights = vec![1e-30; 100];
    let params = BoostingParams { class_weight: ClassWeight::PerClass(vec![1e-30, 1e-30]), ..quick() };
    let tiny = Samples { weights: Some(&weights), ..data.samples() };
    let found = Boosting::fit_with_report(&tiny, None, &params, &Monitor::default());
    assert!(found.unwrap_err().to_string().contains("class_weight"));
    let found = Boosting::fit_with_report(&data.samples(), Some(&tiny), &params, &Monitor::default());
    assert!(found.unwrap_err().to_string().contains("class_weight"));
}

#[test]
fn limits_of_leaves_depth_and_samples_hold() {
    let data = blobs(2000, 6, 3, 0.0);
    let params = BoostingParams { max_depth: Some(3), max_leaves: 64, ..quick() };
    let (model, _) = fit(&data.samples(), &params);
    assert!(model.nodes() <= model.trees() * 15);
    let (model, _) = fit(&data.samples(), &BoostingParams { max_leaves: 7, ..quick() });
    assert!(model.nodes() <= model.trees() * 13);
    let (model, _) = fit(&data.samples(), &BoostingParams { min_samples_leaf: 1001, ..quick() });
    assert_eq!(model.nodes(), model.trees());
    let (model, _) = fit(&data.samples(), &BoostingParams { min_child_weight: 1e6, ..quick() });
    assert_eq!(model.nodes(), model.trees());
}

#[test]
fn samples_that_do_not_fit_and_cancelled_work_are_refused() {
    let data = blobs(100, 4, 2, 0.0);
    let monitor = Monitor::default();
    let other = Samples { width: 2, labels: &data.labels[..50], features: &data.features[..100], ..data.samples() };
    assert!(Boosting::fit_with_report(&data.samples(), Some(&other), &quick(), &monitor).is_err());
    let (model, _) = fit(&data.samples(), &quick());
    assert!(model.predict_proba(&data.features[..5], &mut [0.0; 2]).is_err());
    assert!(model.predict(&data.features[..5]).is_err());
    monitor.cancel();
    assert!(Boosting::fit(&data.samples(), &quick(), &monitor).is_err());
}
