//! Road points: a random forest of two classes on the local descriptors.

use crate::classification::{Forest, ForestParams, Predictor, Samples};
use crate::error::{Error, Result};
use crate::features::FeatureTable;
use crate::parallel::Monitor;

/// Probability that a point is road, for every row of `features`, trained on `examples` (row, whether it is road).
///
/// Guinard & Landrieu 2017, section 2.2: a random forest with the classes road and not road on the four local
/// descriptors ([`crate::features::optimal_features`]); [`ForestParams::breiman`] is the paper's kind of forest. Points
/// with a probability of at least one half count as road ([`is_likely`]).
///
/// # Errors
/// If an example is not a row of the table, no example is road or all are, a parameter is out of range, or the work was
/// cancelled.
pub fn road_probability(
    features: &FeatureTable,
    examples: &[(u32, bool)],
    params: &ForestParams,
    monitor: &Monitor,
) -> Result<Vec<f32>> {
    let road = examples.iter().filter(|e| e.1).count();
    if road == 0 || road == examples.len() {
        return Err(Error::input(format!(
            "{road} of {} examples are road (needed: some that are and some that are not)",
            examples.len()
        )));
    }
    if let Some((row, _)) = examples.iter().find(|e| e.0 as usize >= features.rows()) {
        return Err(Error::input(format!("example {row} is not one of the {} points", features.rows())));
    }
    let rows: Vec<f32> = examples.iter().flat_map(|e| features.row(e.0 as usize)).copied().collect();
    let labels: Vec<u16> = examples.iter().map(|e| u16::from(e.1)).collect();
    let samples = Samples { features: &rows, width: features.width(), labels: &labels, weights: None, classes: 2 };
    let forest = Forest::fit(&samples, params, monitor)?;
    monitor.check()?;
    let mut probabilities = vec![0.0; 2 * features.rows()];
    forest.predict_proba(&features.values, &mut probabilities)?;
    Ok(probabilities.as_chunks::<2>().0.iter().map(|p| p[1]).collect())
}

/// True where the probability is at least one half. O(n).
pub fn is_likely(probabilities: &[f32]) -> Vec<bool> {
    probabilities.iter().map(|&p| p >= 0.5).collect()
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

    #[test]
    fn the_road_is_found_from_thirty_examples() {
        let (features, road) = table();
        let examples: Vec<(u32, bool)> = (0..30).map(|i| (i * 100, road[i as usize * 100])).collect();
        let found = road_probability(&features, &examples, &ForestParams::breiman(), &Monitor::default()).unwrap();
        let right = is_likely(&found).iter().zip(&road).filter(|(a, b)| a == b).count();
        assert!(right > 3800, "{right} of 4000");
    }

    #[test]
    fn examples_of_one_kind_or_of_no_point_are_refused() {
        let (features, _) = table();
        let run = |examples: &[(u32, bool)]| {
            road_probability(&features, examples, &ForestParams::breiman(), &Monitor::default()).map(|_| ())
        };
        assert!(run(&[]).is_err() && run(&[(1, true), (2, true)]).is_err() && run(&[(1, false)]).is_err());
        assert!(run(&[(1, true), (4000, false)]).unwrap_err().to_string().contains("4000"));
    }

    fn shared(name: &str) -> Option<std::path::PathBuf> {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let data = std::env::var_os("SCANSION_DATA").map_or_else(|| root.join("../shared/data"), Into::into);
        let path = data.join(name);
        if !path.exists() {
            println!("skipped: {} is absent", path.display());
        }
        path.exists().then_some(path)
    }

    /// The paper reports an F-score above 99.5 % on its data, from many more labels.
    #[test]
    fn the_ground_of_an_oakland_street_is_found_from_a_hundred_examples() {
        use crate::cloud::{Points, names};
        use crate::features::optimal_features;
        let Some(path) = shared("oakland/part_14.laz") else { return };
        let cloud = crate::io::read(&path).unwrap();
        let points = Points::from_cloud(&cloud, 1.0);
        let codes = cloud.column(names::CLASSIFICATION).unwrap();
        let road: Vec<bool> = points.frame.index.iter().map(|&i| codes.values.get(i as usize) == 2.0).collect();
        let params = crate::neighbours::OptimalParams { k_step: 10, ..Default::default() };
        let features = optimal_features(&points.positions, &params, &Monitor::default()).unwrap().table;
        let mut s = stream(1, 0);
        let examples: Vec<(u32, bool)> = (0..100).map(|_| s.below(points.len())).map(|i| (i as u32, road[i])).collect();
        let found = road_probability(&features, &examples, &ForestParams::breiman(), &Monitor::default()).unwrap();
        let count = |a: bool, b: bool| is_likely(&found).iter().zip(&road).filter(|r| *r == (&a, &b)).count() as f64;
        let score = 2.0 * count(true, true) / (2.0 * count(true, true) + count(true, false) + count(false, true));
        println!("F {score}");
        assert!(score > 0.95, "F {score}");
    }
}
