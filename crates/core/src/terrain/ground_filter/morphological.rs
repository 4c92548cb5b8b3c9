//! Openings of the lowest heights by larger and larger windows: which cells are objects.

use super::GroundParams;
use super::window::Window;
use crate::cloud::Raster;
use crate::error::Result;
use crate::parallel::Monitor;
use crate::terrain::smooth::fill_holes;

/// A cell lower than the closing of its surroundings by more than this many cell edges is noise.
const PIT: f64 = 5.0;

/// The lowest heights, with holes where there are objects.
pub(super) fn bare(lowest: Raster, params: &GroundParams, monitor: &Monitor) -> Result<Raster> {
    let lowest = fill_holes(lowest, monitor)?;
    let columns = lowest.columns();
    let Levelled { mut surface, pit: mut object } = levelled(&lowest, monitor)?;
    for reach in 1..=(params.window / params.cell) as usize {
        let opened = Window::square(columns, reach).opened(&surface, monitor)?;
        let most = params.slope * reach as f64 * params.cell;
        object.iter_mut().zip(surface.iter().zip(&opened)).for_each(|(object, (s, o))| *object |= s - o > most);
        surface = opened;
    }
    let kept = lowest.values().iter().zip(&object).map(|(&z, &object)| if object { f64::NAN } else { z }).collect();
    Ok(lowest.with_values(kept))
}

/// Heights without pits of noise, and where those were.
struct Levelled {
    surface: Vec<f64>,
    pit: Vec<bool>,
}

/// Raises pits of noise to the closing of their surroundings.
fn levelled(filled: &Raster, monitor: &Monitor) -> Result<Levelled> {
    let mut surface = filled.values().to_vec();
    let closed = Window::square(filled.columns(), 1).closed(&surface, monitor)?;
    let pit: Vec<bool> = surface.iter().zip(&closed).map(|(s, c)| c - s > PIT * filled.cell()).collect();
    surface.iter_mut().zip(&closed).zip(&pit).for_each(|((s, c), &pit)| *s = if pit { *c } else { *s });
    Ok(Levelled { surface, pit })
}

/// For each cell of a raster without holes the largest drop by an opening over the reach of its window: with ground no
/// steeper than this the cell is an object. Infinite for pits of noise.
///
/// The reach grows from 1 by a fifth, rounded up: 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 27, ... cells.
pub(super) fn prominence(filled: Raster, window: f64, monitor: &Monitor) -> Result<Vec<f64>> {
    let (columns, cell) = (filled.columns(), filled.cell());
    let Levelled { mut surface, pit } = levelled(&filled, monitor)?;
    drop(filled);
    let mut most: Vec<f64> = pit.iter().map(|&pit| if pit { f64::INFINITY } else { 0.0 }).collect();
    let mut reach = 1;
    while reach as f64 * cell <= window {
        let opened = Window::octagon(columns, reach).opened(&surface, monitor)?;
        let run = reach as f64 * cell;
        most.iter_mut().zip(surface.iter().zip(&opened)).for_each(|(most, (s, o))| *most = most.max((s - o) / run));
        surface = opened;
        reach += reach.div_ceil(5);
    }
    Ok(most)
}
