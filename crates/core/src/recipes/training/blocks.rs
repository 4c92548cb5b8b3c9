//! Folds of whole squares: neighbouring points resemble each other, so that they are held out together.

use crate::classification::cross_validation::grouped_folds;
use crate::cloud::Cloud;
use crate::error::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};

/// Edge of the squares of large scenes, metres.
const LARGEST: f64 = 50.0;
/// Least number of squares a fold, if the edge is chosen.
const SQUARES: usize = 2;
/// The edge is halved at most so often.
const HALVINGS: u32 = 20;

/// A place in plan, metres, and the number of its cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::recipes) struct Place {
    pub(in crate::recipes) cloud: usize,
    pub(in crate::recipes) at: [f64; 2],
}

impl Place {
    /// The place of a point of a cloud with this unit.
    pub(in crate::recipes) fn new(cloud: usize, xyz: [f64; 3], metres: f64) -> Self {
        Self { cloud, at: [xyz[0] * metres, xyz[1] * metres] }
    }

    fn square(&self, edge: f64) -> (usize, [i64; 2]) {
        (self.cloud, self.at.map(|v| (v / edge).floor() as i64))
    }
}

/// The fold of each place, and the edge of the squares.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::recipes) struct SpatialFolds {
    pub(in crate::recipes) of: Vec<u32>,
    /// Metres.
    pub(in crate::recipes) square: f64,
}

/// Divides places into folds of whole squares of an edge, metres; without one 50 m, halved until there are two squares a
/// fold.
///
/// # Errors
/// If there are fewer than 2 folds, the edge is not above 0, or there are fewer squares than folds.
pub(in crate::recipes) fn spatial_folds(places: &[Place], folds: usize, square: Option<f64>) -> Result<SpatialFolds> {
    if folds < 2 {
        return Err(Error::parameter("folds", folds, "2 or more"));
    }
    if let Some(edge) = square.filter(|edge| !(*edge > 0.0 && edge.is_finite())) {
        return Err(Error::parameter("block", edge, "metres, above 0"));
    }
    let count = |edge: f64| places.iter().map(|place| place.square(edge)).collect::<BTreeSet<_>>().len();
    let edge = square.unwrap_or_else(|| {
        let halved = |n: u32| LARGEST / f64::from(1u32 << n);
        (0..HALVINGS).map(halved).find(|&edge| count(edge) >= SQUARES * folds).unwrap_or(halved(HALVINGS))
    });
    let found = count(edge);
    if found < folds {
        let expected = format!(
            "2 to {found}: the labelled samples lie in {found} squares of {edge} m (block); take fewer folds or smaller \
             squares"
        );
        return Err(Error::parameter("folds", folds, expected));
    }
    let mut numbers = BTreeMap::new();
    let mut number = |key| {
        let next = numbers.len() as u32;
        *numbers.entry(key).or_insert(next)
    };
    let groups: Vec<u32> = places.iter().map(|place| number(place.square(edge))).collect();
    Ok(SpatialFolds { of: grouped_folds(&groups, folds)?, square: edge })
}

/// The fold of each point of a cloud, as the cross-validation of recipes divides labelled points: whole squares of
/// `block` metres, without it 50, halved until there are two squares a fold.
///
/// # Errors
/// If there are fewer than 2 folds, the edge is not above 0, there are fewer squares than folds, or the unit is not a
/// length.
pub fn square_folds(cloud: &Cloud, metres_per_unit: Option<f64>, folds: usize, block: Option<f64>) -> Result<Vec<u32>> {
    let metres = cloud.metres(metres_per_unit)?;
    let places: Vec<Place> = (0..cloud.len()).map(|i| Place::new(0, cloud.xyz(i), metres)).collect();
    Ok(spatial_folds(&places, folds, block)?.of)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 400 places on a lattice of this edge.
    fn lattice(edge: f64) -> Vec<Place> {
        let at = |i: i32| (f64::from(i) + 0.5) * edge / 20.0;
        (0..400).map(|i| Place { cloud: 0, at: [at(i % 20), at(i / 20)] }).collect()
    }

    #[test]
    fn squares_are_as_large_as_the_scene_allows_and_stay_together() {
        for (edge, expected) in [(1000.0, 50.0), (150.0, 25.0), (8.0, 1.5625)] {
            let places = lattice(edge);
            let found = spatial_folds(&places, 5, None).unwrap();
            assert_eq!(found.square, expected, "{edge}");
            assert_eq!(found.of.iter().collect::<BTreeSet<_>>().len(), 5);
            for (a, fold) in places.iter().zip(&found.of) {
                let alike = places.iter().zip(&found.of).filter(|(b, _)| a.square(expected) == b.square(expected));
                assert!(alike.into_iter().all(|(_, other)| other == fold));
            }
        }
    }

    #[test]
    fn too_few_squares_are_an_error_that_names_the_cause() {
        let message = spatial_folds(&lattice(8.0), 5, Some(50.0)).unwrap_err().to_string();
        assert!(message.contains("in 1 squares of 50 m") && message.contains("smaller"), "{message}");
        assert!(spatial_folds(&lattice(8.0), 5, Some(0.0)).is_err());
        assert!(spatial_folds(&lattice(8.0), 1, None).is_err());
        // One place for all: no edge gives two squares.
        assert!(spatial_folds(&[Place { cloud: 0, at: [1.0; 2] }; 9], 2, None).is_err());
        let two = [0, 1].map(|cloud| Place { cloud, at: [1.0; 2] });
        assert_eq!(spatial_folds(&two, 2, None).unwrap().of, [0, 1], "squares belong to their cloud");
    }
}
