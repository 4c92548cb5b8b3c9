//! Colours for numbers: a perceptually uniform ramp that is readable for colour-blind people.

/// Control points of the viridis ramp, from low to high.
const RAMP: [[u8; 3]; 10] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 73, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [110, 206, 88],
    [181, 222, 43],
    [253, 231, 37],
];

/// Colour of a share 0..=1; values outside are clamped, NaN is grey.
pub(super) fn ramp(share: f64) -> [f32; 3] {
    if share.is_nan() {
        return [150.0; 3];
    }
    let place = share.clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let low = (place as usize).min(RAMP.len() - 2);
    let part = (place - low as f64) as f32;
    [0, 1, 2].map(|a| f32::from(RAMP[low][a]) * (1.0 - part) + f32::from(RAMP[low + 1][a]) * part)
}

/// Colour of a segment by its number: hues of consecutive numbers differ by the golden ratio; 0 is grey.
pub fn segment_colour(segment: u32) -> [u8; 3] {
    if segment == 0 {
        return [190; 3];
    }
    let hue = (f64::from(segment) * 0.618_033_988_749_894_9).fract() * 6.0;
    let bright = 150.0 + 90.0 * (f64::from(segment) * 0.381_966_011_250_105).fract();
    let level = |shift: f64| {
        let distance = ((hue + shift) % 6.0 - 3.0).abs();
        (bright * (0.25 + 0.75 * (distance - 1.0).clamp(0.0, 1.0))) as u8
    };
    [level(0.0), level(4.0), level(2.0)]
}

/// About `count` round numbers between two values.
pub(super) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return vec![low];
    }
    let step = round_step(span / count.max(1) as f64);
    let first = (low / step).ceil() as i64;
    (first..).map(|i| i as f64 * step).take_while(|&t| t <= high + 1e-9 * span).take(50).collect()
}

/// 1, 2 or 5 times a power of ten, at least `least`.
pub(super) fn round_step(least: f64) -> f64 {
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= least * 0.999_999).unwrap_or(power * 10.0)
}

/// A number without unnecessary digits: three decimals, more for small numbers.
pub(super) fn label(value: f64) -> String {
    let decimals = (2.0 - value.abs().log10().floor()).clamp(3.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.3, 9.7, 5), [2.0, 4.0, 6.0, 8.0]);
        assert_eq!(ticks(-1.0, 1.0, 4), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(round_step(0.03), 0.05);
        assert_eq!(round_step(50.0), 50.0);
        assert_eq!((label(2.50), label(100.0), label(-0.0)), ("2.5".into(), "100".into(), "0".into()));
    }

    #[test]
    fn small_numbers_keep_their_digits() {
        assert_eq!([0.0314, 2e-5, -5e-4, 1e-17].map(label), ["0.0314", "0.00002", "-0.0005", "0"]);
    }

    #[test]
    fn the_ramp_ends_in_its_anchors() {
        assert_eq!(ramp(-1.0), [68.0, 1.0, 84.0]);
        assert_eq!(ramp(2.0), [253.0, 231.0, 37.0]);
        assert_eq!(ramp(f64::NAN), [150.0; 3]);
    }
}
