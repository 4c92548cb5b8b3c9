//! Openings of the lowest heights by larger and larger windows: which cells are objects.

use super::GroundParams;
use super::window::{Opening, Window};
use crate::cloud::Raster;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::terrain::smooth::fill_holes;
use std::mem;

/// A cell lower than the closing of its surroundings by more than this many cell edges is noise.
const PIT: f64 = 5.0;

/// The lowest heights; those of objects are the nearest others.
pub(super) fn bare(lowest: Raster<f32>, params: &GroundParams, monitor: &Monitor) -> Result<Raster<f32>> {
    let lowest = fill_holes(lowest, monitor)?;
    let columns = lowest.columns();
    let Levelled { mut heights, pit: mut object } = levelled(&lowest, monitor)?;
    let mut opening = Opening::default();
    for reach in 1..=(params.window / params.cell) as usize {
        Window::square(columns, reach).open(&heights, &mut opening, monitor)?;
        let most = params.slope * reach as f64 * params.cell;
        object.iter_mut().zip(heights.iter().zip(&opening.opened)).for_each(|(object, (&s, &o))| {
            *object |= f64::from(s) - f64::from(o) > most;
        });
        mem::swap(&mut heights, &mut opening.opened);
    }
    let kept = lowest.values().iter().zip(&object).map(|(&z, &object)| if object { f32::NAN } else { z }).collect();
    fill_holes(lowest.with_values(kept), monitor)
}

/// Heights without pits of noise, and where those were.
struct Levelled {
    heights: Vec<f32>,
    pit: Vec<bool>,
}

/// Raises pits of noise to the closing of their surroundings.
fn levelled(surface: &Raster<f32>, monitor: &Monitor) -> Result<Levelled> {
    let mut heights = Window::square(surface.columns(), 1).closed(surface.values(), monitor)?;
    let deep = PIT * surface.cell();
    let both = surface.values().iter().zip(&heights);
    let pit: Vec<bool> = both.map(|(&s, &c)| f64::from(c) - f64::from(s) > deep).collect();
    let both = heights.iter_mut().zip(surface.values());
    both.zip(&pit).filter(|(_, pit)| !**pit).for_each(|((c, s), _)| *c = *s);
    Ok(Levelled { heights, pit })
}

/// For each cell of a raster without holes the largest drop by an opening over the reach of its window: with ground no
/// steeper than this the cell is an object. Infinite for pits of noise.
///
/// The reach grows from 1 by a fifth, rounded up: 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 27, ... cells.
pub(super) fn prominence(filled: Raster<f32>, window: f64, monitor: &Monitor) -> Result<Vec<f32>> {
    let (columns, cell) = (filled.columns(), filled.cell());
    let Levelled { mut heights, pit } = levelled(&filled, monitor)?;
    drop(filled);
    let mut opening = Opening::default();
    let mut most: Vec<f32> = pit.into_iter().map(|pit| if pit { f32::INFINITY } else { 0.0 }).collect();
    let mut reach = 1;
    while reach as f64 * cell <= window {
        Window::octagon(columns, reach).open(&heights, &mut opening, monitor)?;
        let run = (reach as f64 * cell) as f32;
        let both = heights.iter().zip(&opening.opened);
        most.iter_mut().zip(both).for_each(|(most, (s, o))| *most = most.max((s - o) / run));
        mem::swap(&mut heights, &mut opening.opened);
        reach += reach.div_ceil(5);
    }
    Ok(most)
}
