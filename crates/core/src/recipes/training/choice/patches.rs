//! Patches of a cloud: the points on which methods are compared.

use crate::cloud::MetricCloud;
use crate::error::Result;
use crate::parallel::{Monitor, watched};
use crate::random::{Stream, stream};
use crate::recipes::regularise::ChoiceParams;
use crate::recipes::training::checkerboard::Checkerboard;
use crate::voxels::planar_density;
use std::collections::BTreeMap;

/// A cloud, or a thinned copy, with its labels.
pub(in crate::recipes) struct Labelled<'a> {
    pub(in crate::recipes) scene: &'a MetricCloud<'a>,
    /// Code of each point; `None` without a class that is learned.
    pub(in crate::recipes) codes: &'a [Option<u8>],
    pub(in crate::recipes) board: Checkerboard,
    /// Seed of the choice of patches.
    pub(in crate::recipes) seed: u64,
}

/// Points of some patches, each in a square of its own.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Patches {
    /// Indices in the cloud, ascending.
    pub(super) points: Vec<u32>,
    /// Number of the patch of each point.
    pub(super) of_point: Vec<u32>,
    /// Colour of the square of each patch.
    pub(super) colours: Vec<usize>,
}

/// A random labelled point of a square, and how many it is chosen from.
#[derive(Clone, Copy)]
struct Centre {
    square: [i64; 2],
    point: u32,
    from: usize,
}

impl Centre {
    /// Takes the n-th point that is offered with the probability 1/n.
    fn offer(&mut self, point: u32, random: &mut Stream) {
        self.from += 1;
        if random.below(self.from) == 0 {
            self.point = point;
        }
    }
}

impl Patches {
    /// Random squares with labels, and in each of them a patch around a random labelled point of it. Patches are so
    /// large that [`ChoiceParams::patches`] of them have [`ChoiceParams::points`] points at the mean density, but not
    /// larger than a square.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub(super) fn new(cloud: &Labelled<'_>, params: &ChoiceParams, monitor: &Monitor) -> Result<Self> {
        let points = cloud.scene.points(monitor)?;
        let density = planar_density(&points.positions, monitor)?;
        let area = params.points as f64 / params.patches as f64 / density.max(f64::MIN_POSITIVE);
        let edge = (area.sqrt() / cloud.board.square).min(1.0);
        let mut centres: Vec<Centre> = cloud.centres(&points.frame.index).into_values().collect();
        stream(cloud.seed, 1).shuffle(&mut centres);
        let places: Vec<Place> = centres.iter().map(|centre| cloud.place(centre, edge)).collect();
        let number: BTreeMap<[i64; 2], usize> = centres.iter().map(|centre| centre.square).zip(0..).collect();
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); places.len()];
        for piece in watched(points.len(), monitor) {
            for &point in &points.frame.index[piece?] {
                let xyz = cloud.scene.cloud.xyz(point as usize);
                if let Some(&n) = number.get(&cloud.board.of(xyz))
                    && places[n].holds(cloud.board.place(xyz))
                {
                    members[n].push(point);
                }
            }
        }
        // None if coordinates are so large that the edge of a patch is rounded away.
        members.retain(|members| !members.is_empty());
        // Squares at the border of the cloud hold few points: more patches make up for them.
        let mut count = 0;
        let taken = members.iter().take_while(|members| {
            let wanted = count < params.points;
            count += members.len();
            wanted
        });
        Ok(Self::of(cloud, &taken.collect::<Vec<_>>()))
    }

    fn of(cloud: &Labelled<'_>, members: &[&Vec<u32>]) -> Self {
        let colour = |members: &&Vec<u32>| cloud.board.colour(cloud.scene.cloud.xyz(members[0] as usize));
        let mut all: Vec<(u32, u32)> = Vec::new();
        members.iter().zip(0..).for_each(|(members, n)| all.extend(members.iter().map(|&point| (point, n))));
        all.sort_unstable();
        let (points, of_point) = all.into_iter().unzip();
        Self { points, of_point, colours: members.iter().map(colour).collect() }
    }
}

/// A patch, in squares of the checkerboard: its lower corner and its edge.
#[derive(Clone, Copy)]
struct Place {
    corner: [f64; 2],
    edge: f64,
}

impl Place {
    fn holds(&self, place: [f64; 2]) -> bool {
        place.iter().zip(self.corner).all(|(v, low)| *v >= low && *v <= low + self.edge)
    }
}

impl Labelled<'_> {
    /// A random point of a random class of each square that has any, so that patches show rare classes too.
    fn centres(&self, points: &[u32]) -> BTreeMap<[i64; 2], Centre> {
        let mut random = stream(self.seed, 0);
        let mut of_classes: BTreeMap<([i64; 2], u8), Centre> = BTreeMap::new();
        for &point in points {
            let Some(code) = self.codes[point as usize] else { continue };
            let square = self.board.of(self.scene.cloud.xyz(point as usize));
            let new = Centre { square, point, from: 0 };
            of_classes.entry((square, code)).or_insert(new).offer(point, &mut random);
        }
        let mut found = BTreeMap::new();
        for Centre { square, point, .. } in of_classes.into_values() {
            found.entry(square).or_insert(Centre { square, point, from: 0 }).offer(point, &mut random);
        }
        found
    }

    /// The patch of this edge around a point, moved into its square.
    fn place(&self, centre: &Centre, edge: f64) -> Place {
        let at = self.board.place(self.scene.cloud.xyz(centre.point as usize));
        let corner = [0, 1].map(|axis| {
            let low = centre.square[axis] as f64;
            (at[axis] - 0.5 * edge).min(low + 1.0 - edge).max(low)
        });
        Place { corner, edge }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    fn grid(side: usize, step: f64) -> Cloud {
        let at = |i: usize| [(i % side) as f64 * step, (i / side) as f64 * step, 0.0];
        Cloud::from_rows(&(0..side * side).map(at).collect::<Vec<_>>()).unwrap()
    }

    fn patches(cloud: &Cloud, codes: &[Option<u8>], params: &ChoiceParams) -> Patches {
        let scene = MetricCloud::new(cloud, None, &Monitor::default()).unwrap();
        let board = Checkerboard::of_cloud(&scene, None);
        Patches::new(&Labelled { scene: &scene, codes, board, seed: 1 }, params, &Monitor::default()).unwrap()
    }

    #[test]
    fn patches_lie_in_squares_of_their_own_and_are_as_large_as_asked_for() {
        let cloud = grid(200, 0.5);
        let params = ChoiceParams { points: 4000, patches: 8, ..ChoiceParams::default() };
        let found = patches(&cloud, &vec![Some(2); cloud.len()], &params);
        assert!((8..=12).contains(&found.colours.len()), "{}", found.colours.len());
        assert!((4000..4600).contains(&found.points.len()), "{}", found.points.len());
        assert!(found.points.windows(2).all(|pair| pair[0] < pair[1]));
        let board = Checkerboard { square: 99.5 / 4.0, metres: 1.0 };
        for n in 0..found.colours.len() as u32 {
            let own = found.points.iter().zip(&found.of_point).filter(|(_, of)| **of == n).map(|(point, _)| *point);
            let squares: Vec<[i64; 2]> = own.map(|point| board.of(cloud.xyz(point as usize))).collect();
            assert!(squares.iter().all(|square| *square == squares[0]));
        }
    }

    #[test]
    fn a_small_cloud_gives_all_its_squares_and_one_without_labels_none() {
        let cloud = grid(20, 0.5);
        let all = patches(&cloud, &vec![Some(2); 400], &ChoiceParams::default());
        assert_eq!(all.points.len(), 400);
        assert!(patches(&cloud, &vec![None; 400], &ChoiceParams::default()).points.is_empty());
    }
}
