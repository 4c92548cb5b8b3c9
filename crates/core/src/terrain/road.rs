//! Road points: a random forest of two classes on the local descriptors.

use crate::classification::{ClassWeight, Forest, ForestParams, Predictor, Samples};
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::parallel::Monitor;
use serde::{Deserialize, Serialize};

/// A labelled point and whether it is road.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoadExample {
    /// Linearity, planarity, scattering, verticality.
    pub descriptors: [f32; 4],
    /// Whether its class is one of road.
    pub road: bool,
}

/// The points that are road: those that a forest trained on these examples considers at least as likely road as not.
///
/// Guinard & Landrieu 2017, section 2.2: a random forest with the classes road and not road on the four local
/// descriptors ([`crate::features::optimal_features`]), one row of `local` a point; [`ForestParams::breiman`] is the
/// paper's kind of forest. O(points · trees · depth); a point skips the remaining trees once they cannot change its
/// class.
///
/// # Errors
/// If no example is road or all are, the table does not have four columns, a parameter is out of range, or the work was
/// cancelled.
pub fn road_points(
    local: &FeatureTable,
    examples: &[RoadExample],
    params: &ForestParams,
    monitor: &Monitor,
) -> Result<Vec<bool>> {
    let road = examples.iter().filter(|e| e.road).count();
    if road == 0 || road == examples.len() {
        return Err(Error::input(format!(
            "{road} of {} examples are road (needed: some that are and some that are not)",
            examples.len()
        )));
    }
    let rows: Vec<f32> = examples.iter().flat_map(|e| e.descriptors).collect();
    // Road is the first class, so that it wins ties.
    let labels: Vec<u16> = examples.iter().map(|e| u16::from(!e.road)).collect();
    let samples = Samples { features: &rows, width: local.width(), labels: &labels, weights: None, classes: 2 };
    let mut params = params.clone();
    if let ClassWeight::PerClass(weights) = &mut params.class_weight {
        weights.reverse();
    }
    let forest = Forest::fit(&samples, &params, monitor)?;
    monitor.check()?;
    Ok(forest.predict(&local.values)?.into_iter().map(|class| class == 0).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;

    fn table() -> (FeatureTable, Vec<bool>) {
        let mut s = stream(5, 5);
        let road: Vec<bool> = (0..4000).map(|_| s.uniform() < 0.4).collect();
        let values = road
            .iter()
            .flat_map(|&r| {
                let vertical = if r { 0.1 * s.uniform() } else { 0.2 + 0.8 * s.uniform() };
                [s.uniform(), s.uniform(), s.uniform(), vertical].map(|v| v as f32)
            })
            .collect();
        (FeatureTable { names: ["l", "p", "s", "v"].map(str::to_owned).to_vec(), values }, road)
    }

    fn example(local: &FeatureTable, point: usize, road: bool) -> RoadExample {
        RoadExample { descriptors: *local.row(point).first_chunk().unwrap(), road }
    }

    #[test]
    fn the_road_is_found_from_thirty_examples() {
        let (features, road) = table();
        let examples: Vec<RoadExample> = (0..30).map(|i| example(&features, i * 100, road[i * 100])).collect();
        let found = road_points(&features, &examples, &ForestParams::breiman(), &Monitor::default()).unwrap();
        let right = found.iter().zip(&road).filter(|(a, b)| a == b).count();
        assert!(right > 3800, "{right} of 4000");
    }

    #[test]
    fn examples_of_one_kind_are_refused() {
        let (features, _) = table();
        let run = |road: &[bool]| {
            let examples: Vec<RoadExample> = road.iter().map(|&road| example(&features, 1, road)).collect();
            road_points(&features, &examples, &ForestParams::breiman(), &Monitor::default())
        };
        assert!(
            run(&[]).is_err() && run(&[true, true]).is_err() && run(&[false]).is_err() && run(&[true, false]).is_ok()
        );
    }

    #[test]
    fn road_is_what_the_forest_gives_a_probability_of_one_half_or_more() {
        let mut random = stream(11, 0);
        // Coarse values: equal rows of both classes give impure leaves, and ties.
        let mut row = || [0; 4].map(|_| (random.uniform() * 20.0).round() as f32 / 20.0);
        let examples: Vec<RoadExample> =
            (0..300).map(|i| RoadExample { descriptors: row(), road: i % 3 == 0 }).collect();
        let values: Vec<f32> = (0..3000).flat_map(|_| row()).collect();
        let names = ["a", "b", "c", "d"].map(str::to_string).to_vec();
        let local = FeatureTable { names, values };
        let rows: Vec<f32> = examples.iter().flat_map(|e| e.descriptors).collect();
        let labels: Vec<u16> = examples.iter().map(|e| u16::from(e.road)).collect();
        let samples = Samples { features: &rows, width: 4, labels: &labels, weights: None, classes: 2 };
        for trees in [1, 2, 10, 100] {
            let params = ForestParams { trees, max_depth: (trees == 10).then_some(3), ..ForestParams::breiman() };
            let found = road_points(&local, &examples, &params, &Monitor::default()).unwrap();
            let forest = Forest::fit(&samples, &params, &Monitor::default()).unwrap();
            let mut probabilities = vec![0.0; 2 * 3000];
            forest.predict_proba(&local.values, &mut probabilities).unwrap();
            let expected: Vec<bool> = probabilities.chunks(2).map(|p| p[1] >= 0.5).collect();
            assert_eq!(found, expected, "{trees} trees");
            assert!(found.contains(&true) && found.contains(&false));
        }
    }
}
