//! The k nearest neighbours of all points compared with the crates `kiddo` and `nabo`, building included, in alternating
//! runs: `cargo run --profile quick -p scansion-benches --example neighbours_peers -- FILE.laz`.
//!
//! `SCANSION_POINTS` names how many points from the start of the file (`1000000,0`; 0: all), `SCANSION_K` the numbers of
//! neighbours (`10,45`), `SCANSION_RUNS` how often (3) and `SCANSION_PEERS` whom (`kiddo,nabo`). All fill the same two
//! arrays, indices and squared distances, with the threads of rayon's pool (`RAYON_NUM_THREADS`); peers are asked for one
//! neighbour more, because they return the point itself. Medians of wall and processor seconds are printed.
//!
//! The same for all points within a radius (`SCANSION_RADII`, metres, `1`), beside `kiddo` only: `nabo` has no such query.
//! Ours are sorted by distance, kiddo's are not; the numbers of neighbours must be the same.
//!
//! Then the rows of the peers are compared with ours: how many hold another set of points, and how many of these other
//! distances, that is, not just other points of the same distance.

#![allow(clippy::print_stdout, reason = "a program for people")]

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nabo::{KDTree, NotNan, Point};
use rayon::prelude::*;
use scansion_core::cloud::{Points, Positions};
use scansion_core::io::{self, Columns, ReadOptions};
use scansion_core::neighbours::{Neighbours, knn, within};
use scansion_core::parallel::Monitor;
use std::num::NonZero;
use std::path::Path;
use std::time::Instant;

type Outcome<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// Points of one task.
const BLOCK: usize = 512;

/// A point as `nabo` wants it.
#[derive(Clone, Copy, Debug, Default)]
struct Place([f32; 3]);

impl Point<f32> for Place {
    const DIM: u32 = 3;

    fn set(&mut self, i: u32, value: NotNan<f32>) {
        self.0[i as usize] = value.into_inner();
    }

    fn get(&self, i: u32) -> NotNan<f32> {
        NotNan::new(self.0[i as usize]).unwrap_or_default()
    }
}

/// A neighbour that a peer found.
#[derive(Clone, Copy, Debug)]
struct Found {
    index: u32,
    squared: f32,
}

/// A search tree of a peer.
enum Tree {
    Kiddo(Box<ImmutableKdTree<f32, 3>>),
    Nabo(KDTree<f32, Place>),
}

impl Tree {
    fn build(peer: &str, places: &[[f32; 3]]) -> Outcome<Self> {
        match peer {
            "kiddo" => Ok(Self::Kiddo(Box::new(
                ImmutableKdTree::new_from_slice_parallel(places).map_err(|e| format!("{e:?}"))?,
            ))),
            "nabo" => Ok(Self::Nabo(KDTree::new(&places.iter().map(|&p| Place(p)).collect::<Vec<_>>()))),
            other => Err(format!("peer {other}: kiddo or nabo").into()),
        }
    }

    /// The `k` nearest points, the nearest first; the point itself may be among them.
    fn nearest(&self, place: [f32; 3], k: NonZero<usize>) -> impl Iterator<Item = Found> {
        let (kiddo, nabo) = match self {
            Self::Kiddo(tree) => (tree.query(&place).nearest_n::<SquaredEuclidean<f32>>(k).execute(), Vec::new()),
            Self::Nabo(tree) => (Vec::new(), tree.knn(k.get() as u32, &Place(place))),
        };
        let kiddo = kiddo.into_iter().map(|n| Found { index: n.item, squared: n.distance });
        kiddo.chain(nabo.into_iter().map(|n| Found { index: n.index, squared: n.dist2.into_inner() }))
    }

    /// The `k` nearest other points of point `i`: without the point itself, or without the last if it was not found.
    fn others(&self, places: &[[f32; 3]], i: usize, k: usize) -> impl Iterator<Item = Found> {
        let all = self.nearest(places[i], NonZero::<usize>::MIN.saturating_add(k));
        all.filter(move |n| n.index as usize != i).take(k)
    }
}

/// The answer of a peer in the form of ours: rows of indices and of squared distances.
fn rows(tree: &Tree, places: &[[f32; 3]], k: usize) -> (Vec<u32>, Vec<f32>) {
    let (mut index, mut squared) = (vec![0; places.len() * k], vec![0.0; places.len() * k]);
    let blocks = index.par_chunks_mut(BLOCK * k).zip(squared.par_chunks_mut(BLOCK * k)).enumerate();
    blocks.for_each(|(b, (index, squared))| {
        for (r, (index, squared)) in index.chunks_mut(k).zip(squared.chunks_mut(k)).enumerate() {
            for ((to, distance), n) in index.iter_mut().zip(squared).zip(tree.others(places, b * BLOCK + r, k)) {
                (*to, *distance) = (n.index, n.squared);
            }
        }
    });
    (index, squared)
}

/// Wall and processor seconds.
#[derive(Clone, Copy, Debug, Default)]
struct Seconds {
    wall: f64,
    processor: f64,
}

/// Processor time of this process, user and system, in seconds.
fn processor() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|f| f.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// Time of a search; its answer is dropped outside it.
fn timed<T>(work: impl FnOnce() -> Outcome<T>) -> Outcome<Seconds> {
    let (start, spent) = (Instant::now(), processor());
    let answer = work()?;
    let seconds = Seconds { wall: start.elapsed().as_secs_f64(), processor: processor() - spent };
    drop(answer);
    Ok(seconds)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Prints times and ratios of ours and of the peers.
fn compare(points: &Positions, places: &[[f32; 3]], peers: &[&str], k: usize, runs: usize) -> Outcome<()> {
    let mut times: Vec<Vec<Seconds>> = vec![Vec::new(); peers.len() + 1];
    for _ in 0..runs {
        times[0].push(timed(|| Ok(knn(points, k, &Monitor::default())?))?);
        for (times, peer) in times[1..].iter_mut().zip(peers) {
            times.push(timed(|| Ok(rows(&Tree::build(peer, places)?, places, k)))?);
        }
    }
    let medians = |times: &[Seconds]| Seconds {
        wall: median(times.iter().map(|t| t.wall).collect()),
        processor: median(times.iter().map(|t| t.processor).collect()),
    };
    let ours = medians(&times[0]);
    for (name, times) in ["ours"].iter().chain(peers).zip(&times) {
        let theirs = medians(times);
        println!(
            "{} points, k = {k}, {name}: {:.2} s wall, {:.2} s processor; ratio {:.2} wall, {:.2} processor; runs {:.2?}",
            places.len(),
            theirs.wall,
            theirs.processor,
            theirs.wall / ours.wall,
            theirs.processor / ours.processor,
            times.iter().map(|t| t.processor).collect::<Vec<_>>(),
        );
    }
    Ok(())
}

/// Prints times and ratio of a radius search around all points.
fn compare_radius(points: &Positions, places: &[[f32; 3]], radius: f64, runs: usize) -> Outcome<()> {
    let limit = (radius * radius) as f32;
    let (mut ours, mut theirs, mut found) = (Vec::new(), Vec::new(), [0, 0]);
    for _ in 0..runs {
        ours.push(timed(|| {
            let near = within(points, points, radius, &Monitor::default())?;
            found[0] = (0..points.len()).map(|i| near.of(i).len()).sum::<usize>();
            Ok(near)
        })?);
        theirs.push(timed(|| {
            let Tree::Kiddo(tree) = Tree::build("kiddo", places)? else { return Err("kiddo".into()) };
            let near = places.par_iter().with_min_len(BLOCK).map(|place| {
                let all = tree.query(place).within::<SquaredEuclidean<f32>>(limit).execute();
                all.into_iter().map(|n| (n.item, n.distance)).collect::<Vec<(u32, f32)>>()
            });
            let near: Vec<Vec<(u32, f32)>> = near.collect();
            found[1] = near.iter().map(Vec::len).sum();
            Ok(near)
        })?);
    }
    let processor = |times: &[Seconds]| median(times.iter().map(|t| t.processor).collect());
    let (ours, theirs) = (processor(&ours), processor(&theirs));
    println!(
        "{} points within {radius} m: ours {ours:.2} s, kiddo {theirs:.2} s processor; ratio {:.2}; {} and {} neighbours",
        places.len(),
        theirs / ours,
        found[0],
        found[1]
    );
    Ok(())
}

/// Rows of a peer that differ from ours.
#[derive(Clone, Copy, Debug, Default)]
struct Differences {
    /// Another set of points.
    points: usize,
    /// Other distances.
    distances: usize,
}

impl Differences {
    fn of_row(near: &Neighbours, tree: &Tree, places: &[[f32; 3]], i: usize) -> Self {
        let mut found: Vec<Found> = tree.others(places, i, near.k()).collect();
        found.sort_by(|a, b| a.squared.total_cmp(&b.squared).then(a.index.cmp(&b.index)));
        let points = !found.iter().map(|f| f.index).eq(near.of(i).iter().copied());
        let ours = near.squared_distances(i).iter().map(|d| d.to_bits());
        let distances = !found.iter().map(|f| f.squared.to_bits()).eq(ours);
        Self { points: points.into(), distances: distances.into() }
    }

    fn and(self, other: Self) -> Self {
        Self { points: self.points + other.points, distances: self.distances + other.distances }
    }
}

/// Prints in how many rows the peers differ; their rows are compared one by one and not kept.
fn differences(points: &Positions, places: &[[f32; 3]], peers: &[&str], k: usize) -> Outcome<()> {
    let near = knn(points, k, &Monitor::default())?;
    for peer in peers {
        let tree = Tree::build(peer, places)?;
        let rows = (0..places.len()).into_par_iter().with_min_len(BLOCK);
        let count = rows.map(|i| Differences::of_row(&near, &tree, places, i));
        let Differences { points, distances } = count.reduce(Differences::default, Differences::and);
        println!("{} points, k = {k}, {peer}: {points} rows differ, {distances} of them in a distance", places.len());
    }
    Ok(())
}

/// The first points of a cloud; all if `count` is 0.
fn first(all: &Positions, count: usize) -> Positions {
    let count = if count == 0 { all.len() } else { count.min(all.len()) };
    all.iter().take(count).collect()
}

fn numbers(name: &str, other: &str) -> Outcome<Vec<usize>> {
    let text = std::env::var(name).unwrap_or_else(|_| other.to_owned());
    Ok(text.split(',').map(str::parse).collect::<Result<_, _>>()?)
}

fn main() -> Outcome<()> {
    let file = std::env::args().nth(1).ok_or("a file of points")?;
    let options = ReadOptions { columns: Columns::Only(Vec::new()), ..ReadOptions::default() };
    let all = Points::from_cloud(&io::read_with(Path::new(&file), &options)?, 1.0).positions;
    let peers = std::env::var("SCANSION_PEERS").unwrap_or_else(|_| "kiddo,nabo".into());
    let peers: Vec<&str> = peers.split(',').collect();
    let (runs, ks) = (scansion_benches::number("SCANSION_RUNS", 3), numbers("SCANSION_K", "10,45")?);
    for count in numbers("SCANSION_POINTS", "1000000,0")? {
        let points = first(&all, count);
        let places: Vec<[f32; 3]> = points.iter().collect();
        for radius in std::env::var("SCANSION_RADII").unwrap_or_else(|_| "1".into()).split(',') {
            compare_radius(&points, &places, radius.parse()?, runs)?;
        }
        for &k in &ks {
            compare(&points, &places, &peers, k, runs)?;
            differences(&points, &places, &peers, k)?;
        }
    }
    Ok(())
}
