//! Quantisation of features: ascending cut points for each feature, and the code of a value among them.
//!
//! The code of `x` is the number of cuts `t` with `x > t`. NaN is greater than nothing and gets the code 0: missing
//! values go left at every node. If the samples contain NaN, the first cut is the lowest finite number, so that code 0
//! stands for NaN only.

use super::quantise::{CodeBlock, Column, CutTable, QuantiseRows, QuantiseTiles, SPARE, TILE};
use super::samples::Samples;
use crate::error::{Error, Result};
use crate::parallel::{Monitor, map_ordered};
use crate::random::stream;

/// Parameters of [`Binning::fit`].
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BinningParams {
    /// Largest number of bins a feature, 2..=255 (not counting the bin of NaN).
    pub max_bins: usize,
    /// Number of rows from which the quantiles are estimated, 2 or more.
    pub sample: usize,
    /// Seed of the choice of these rows.
    pub seed: u64,
}

impl Default for BinningParams {
    fn default() -> Self {
        Self { max_bins: 255, sample: 200_000, seed: 0 }
    }
}

impl BinningParams {
    /// Checks the ranges.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        if !(2..=255).contains(&self.max_bins) {
            return Err(Error::parameter("max_bins", self.max_bins, "2 to 255"));
        }
        match self.sample < 2 {
            true => Err(Error::parameter("sample", self.sample, "2 or more")),
            false => Ok(()),
        }
    }
}

/// Cut points of every feature: finite and strictly ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Binning {
    offsets: Vec<u32>,
    cuts: Vec<f32>,
    /// The cuts of each feature padded to 255 with infinity; empty if a feature has more than 255 cuts.
    tables: Vec<CutTable>,
}

impl Binning {
    /// Cuts at the quantiles of the rows of positive weight; each distinct value gets a bin of its own if there are
    /// enough bins.
    ///
    /// # Errors
    /// If samples are inconsistent, a parameter is out of range, or the work was cancelled.
    pub fn fit(samples: &Samples<'_>, params: &BinningParams, monitor: &Monitor) -> Result<Self> {
        params.validate()?;
        samples.check()?;
        monitor.check()?;
        let active = samples.active();
        monitor.check()?;
        let chosen = match active.len() <= params.sample {
            true => active,
            false => {
                let picks = stream(params.seed, u64::MAX).choose(active.len(), params.sample);
                picks.into_iter().map(|i| active[i as usize]).collect()
            }
        };
        let column = |f: usize| chosen.iter().map(|&i| samples.features[i as usize * samples.width + f]).collect();
        Self::new(map_ordered(samples.width, monitor, |f| Ok(quantile_cuts(column(f), params.max_bins)))?)
    }

    /// A quantisation with given cut points of every feature.
    ///
    /// # Errors
    /// If cuts are not finite or not strictly ascending, or a feature has more than 65535 of them.
    pub fn new(cuts: Vec<Vec<f32>>) -> Result<Self> {
        let mut offsets = vec![0u32];
        for (f, cuts) in cuts.iter().enumerate() {
            let rising = cuts.windows(2).all(|w| w[0] < w[1]);
            if !rising || cuts.iter().any(|t| !t.is_finite()) {
                return Err(Error::input(format!("cut points of feature {f} must be finite and strictly ascending")));
            }
            if cuts.len() > 65_535 {
                return Err(Error::input(format!("feature {f} has {} cut points; 65535 are allowed", cuts.len())));
            }
            offsets.push(offsets[f] + cuts.len() as u32);
        }
        let narrow = cuts.iter().all(|c| c.len() <= 255);
        let tables = if narrow { cuts.iter().map(|c| CutTable::new(c)).collect() } else { Vec::new() };
        Ok(Self { offsets, cuts: cuts.concat(), tables })
    }

    /// Number of features.
    pub fn width(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Cut points of feature `f`, ascending.
    pub fn cuts(&self, f: usize) -> &[f32] {
        &self.cuts[self.offsets[f] as usize..self.offsets[f + 1] as usize]
    }

    /// True if every code fits in 8 bits.
    pub fn fits_u8(&self) -> bool {
        self.tables.len() == self.width()
    }

    /// Code of a value of feature `f`, `0..=cuts(f).len()`.
    pub fn code(&self, f: usize, x: f32) -> u16 {
        self.cuts(f).partition_point(|&t| x > t) as u16
    }

    /// Codes of row-major values, in the same layout.
    ///
    /// # Errors
    /// If lengths do not fit, or a feature has more than 255 cuts.
    pub fn bin_block(&self, values: &[f32], codes: &mut [u8]) -> Result<()> {
        if !self.fits_u8()
            || self.width() == 0
            || values.len() != codes.len()
            || !values.len().is_multiple_of(self.width())
        {
            return Err(Error::input(format!(
                "{} values and {} codes do not make whole rows of {} features with 8-bit codes",
                values.len(),
                codes.len(),
                self.width()
            )));
        }
        pulp::Arch::new().dispatch(QuantiseRows { tables: &self.tables, values, codes });
        Ok(())
    }

    /// Codes of row-major values, row by row.
    pub(super) fn bin_rows(&self, values: &[f32], codes: &mut CodeBlock<u8>) {
        self.shape(values, self.width(), codes);
        codes.by_row.resize(values.len(), 0);
        pulp::Arch::new().dispatch(QuantiseRows { tables: &self.tables, values, codes: &mut codes.by_row });
    }

    /// As [`Binning::bin_rows`], for binnings of any size.
    pub(super) fn bin_rows_wide(&self, values: &[f32], codes: &mut CodeBlock<u16>) {
        self.shape(values, self.width(), codes);
        codes.by_row.resize(values.len(), 0);
        self.bin_wide(values, &mut codes.by_row);
    }

    /// Codes of row-major values in tiles.
    pub(super) fn bin_tiles(&self, values: &[f32], codes: &mut CodeBlock<u8>) {
        self.bin_both(values, 0, codes);
    }

    /// Codes of row-major values in tiles, and row by row with this stride (0: not at all), followed by [`SPARE`]
    /// codes.
    pub(super) fn bin_both(&self, values: &[f32], stride: usize, codes: &mut CodeBlock<u8>) {
        self.shape(values, stride, codes);
        codes.by_tile.resize(codes.rows.div_ceil(TILE) * codes.width, Column([0; TILE]));
        codes.by_row.resize(codes.rows * stride + SPARE, 0);
        let by_row = codes.by_row.get_mut(..codes.rows * stride).unwrap_or_default();
        let (tables, codes) = (&self.tables, &mut codes.by_tile);
        pulp::Arch::new().dispatch(QuantiseTiles { tables, values, codes, by_row, stride });
    }

    fn shape<C>(&self, values: &[f32], stride: usize, codes: &mut CodeBlock<C>) {
        (codes.rows, codes.width) = (values.len() / self.width().max(1), self.width());
        codes.stride = stride;
    }

    /// The cuts of these features only.
    pub(super) fn select(&self, features: &[usize]) -> Self {
        let cuts: Vec<Vec<f32>> = features.iter().map(|&f| self.cuts(f).to_vec()).collect();
        let tables = if self.fits_u8() { cuts.iter().map(|c| CutTable::new(c)).collect() } else { Vec::new() };
        let mut offsets = vec![0u32];
        cuts.iter().for_each(|c| offsets.push(offsets.last().copied().unwrap_or(0) + c.len() as u32));
        Self { offsets, cuts: cuts.concat(), tables }
    }

    /// Codes of row-major values as 16 bits, for binnings of any size; lengths as in [`Binning::bin_block`].
    pub(super) fn bin_wide(&self, values: &[f32], codes: &mut [u16]) {
        let width = self.width().max(1);
        for (values, codes) in values.chunks_exact(width).zip(codes.chunks_exact_mut(width)) {
            for (f, (code, &x)) in codes.iter_mut().zip(values).enumerate() {
                *code = self.code(f, x);
            }
        }
    }
}

/// Middle of `a < b`, rounded so that `a <= middle < b`.
pub(super) fn middle(a: f32, b: f32) -> f32 {
    let middle = (0.5 * (f64::from(a) + f64::from(b))) as f32;
    if middle >= b || !middle.is_finite() { a } else { middle }
}

fn quantile_cuts(mut values: Vec<f32>, max_bins: usize) -> Vec<f32> {
    let all = values.len();
    values.retain(|v| !v.is_nan());
    let missing = values.len() < all;
    // Infinities count as the outermost finite numbers.
    values.iter_mut().for_each(|v| *v = v.clamp(f32::MIN, f32::MAX));
    values.sort_unstable_by(f32::total_cmp);
    let gaps: Vec<usize> = (1..values.len()).filter(|&i| values[i - 1] < values[i]).collect();
    let mut cuts: Vec<f32> = match gaps.len() < max_bins {
        true => gaps.iter().map(|&i| middle(values[i - 1], values[i])).collect(),
        false => (1..max_bins)
            .filter_map(|k| gaps.get(gaps.partition_point(|&g| g < k * values.len() / max_bins)))
            .map(|&i| middle(values[i - 1], values[i]))
            .collect(),
    };
    cuts.dedup();
    if missing && cuts.first() != Some(&f32::MIN) {
        cuts.insert(0, f32::MIN);
    }
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_search_counts_the_cuts_below() {
        for n in [0usize, 1, 7, 254, 255] {
            let cuts: Vec<f32> = (0..n).map(|i| i as f32 * 0.5 - 20.0).collect();
            let binning = Binning::new(vec![cuts.clone()]).unwrap();
            let probes = (-100..400).map(|i| i as f32 * 0.25).chain([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
            for x in probes {
                let mut code = [0];
                binning.bin_block(&[x], &mut code).unwrap();
                assert_eq!(usize::from(code[0]), cuts.iter().filter(|&&t| x > t).count(), "{n} {x}");
                assert_eq!(u16::from(code[0]), binning.code(0, x));
            }
        }
    }

    #[test]
    fn few_distinct_values_get_a_bin_each_and_nan_its_own() {
        let values = [3.0, 1.0, f32::NAN, 2.0, 1.0];
        let samples = Samples { features: &values, width: 1, labels: &[0; 5], weights: None, classes: 1 };
        let binning = Binning::fit(&samples, &BinningParams::default(), &Monitor::default()).unwrap();
        assert_eq!(binning.cuts(0), [f32::MIN, 1.5, 2.5]);
        let mut codes = [9; 5];
        binning.bin_block(&values, &mut codes).unwrap();
        assert_eq!(codes, [3, 1, 0, 2, 1]);
    }

    #[test]
    fn many_values_fill_the_bins_evenly() {
        let values: Vec<f32> = (0..10_000).map(|i| (i as f32).powi(3)).collect();
        let labels = vec![0; values.len()];
        let samples = Samples { features: &values, width: 1, labels: &labels, weights: None, classes: 1 };
        let binning = Binning::fit(&samples, &BinningParams::default(), &Monitor::default()).unwrap();
        let mut codes = vec![0; values.len()];
        binning.bin_block(&values, &mut codes).unwrap();
        let mut counts = [0u32; 256];
        codes.iter().for_each(|&c| counts[usize::from(c)] += 1);
        assert!(binning.cuts(0).len() == 254 && counts[..255].iter().all(|&c| (38..=41).contains(&c)), "{counts:?}");
    }

    #[test]
    fn the_middle_stays_below_the_upper_value() {
        let a = 1.0f32;
        let b = f32::from_bits(a.to_bits() + 1);
        assert!(middle(a, b) >= a && middle(a, b) < b);
        assert!(middle(f32::MIN, f32::MAX).abs() < 1.0);
    }

    #[test]
    fn cuts_out_of_order_are_refused() {
        assert!(Binning::new(vec![vec![1.0, 1.0]]).is_err());
        assert!(Binning::new(vec![vec![f32::NAN]]).is_err());
        assert!(Binning::new(vec![vec![1.0, f32::INFINITY]]).is_err());
    }
}
