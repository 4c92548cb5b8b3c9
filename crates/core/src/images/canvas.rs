//! The picture: pixels, and the layout of cloud, legend and title.

use super::RenderParams;
use super::camera::Camera;
use crate::error::{Error, Result};
use crate::parallel::Monitor;
use std::io::Write;

pub(super) const MARGIN: u32 = 24;
pub(super) const LEGEND: u32 = 290;
const TITLE: u32 = 36;
const FOOTER: u32 = 44;
/// Bytes of pixels that are compressed between two checks for cancellation.
const PIXELS: usize = 256 << 10;
/// Supersampling: points are drawn on a grid this many times finer than the pixels.
pub(super) const FINER: usize = 2;
pub(super) const PAPER: [f32; 3] = [250.0, 250.0, 248.0];
pub(super) const INK: [u8; 3] = [38, 42, 46];

/// A picture in sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row from the top; red, green, blue.
    pub rgb: Vec<u8>,
    /// World file of a map: coordinates of pixel centres are x = a u + c, y = e v + f, in `[a, 0, 0, e, c, f]`.
    pub world: Option<[f64; 6]>,
}

impl Image {
    /// An empty picture.
    pub(super) fn blank(width: u32, height: u32) -> Self {
        let rgb = PAPER.map(|c| c as u8).repeat((width * height) as usize);
        Self { width, height, rgb, world: None }
    }

    /// Blends a colour into a pixel; positions outside are ignored.
    pub(super) fn mix(&mut self, [x, y]: [i64; 2], colour: [u8; 3], share: f32) {
        if x < 0 || y < 0 || x >= i64::from(self.width) || y >= i64::from(self.height) {
            return;
        }
        let at = 3 * (y as usize * self.width as usize + x as usize);
        for (slot, c) in self.rgb[at..at + 3].iter_mut().zip(colour) {
            *slot = (f32::from(*slot) * (1.0 - share) + f32::from(c) * share).round() as u8;
        }
    }

    /// Fills a rectangle: its upper left corner, its width and height.
    pub(super) fn rectangle(&mut self, [x, y]: [i64; 2], [width, height]: [i64; 2], colour: [u8; 3]) {
        for v in y..y + height {
            (x..x + width).for_each(|u| self.mix([u, v], colour, 1.0));
        }
    }

    /// The picture as PNG.
    ///
    /// # Errors
    /// If the work was cancelled.
    pub fn to_png(&self, monitor: &Monitor) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let failed = |e: png::EncodingError| Error::input(format!("picture of {} x {}: {e}", self.width, self.height));
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(failed)?;
        let mut rows = writer.stream_writer().map_err(failed)?;
        for pixels in self.rgb.chunks(PIXELS) {
            monitor.check()?;
            rows.write_all(pixels).map_err(|e| failed(e.into()))?;
        }
        rows.finish().map_err(failed)?;
        writer.finish().map_err(failed)?;
        Ok(bytes)
    }

    /// Text of the world file by which a GIS georeferences a map; `None` for other pictures.
    pub fn world_file(&self) -> Option<String> {
        let [a, d, b, e, c, f] = self.world?;
        Some([a, d, b, e, c, f].map(|v| format!("{v:.10}\n")).concat())
    }
}

/// The layout of the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Upper left corner and size of the cloud's part, in pixels.
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) w: u32,
    pub(super) h: u32,
    /// Units of the coordinates per pixel.
    pub(super) unit: f64,
    /// Position of the upper left corner on the picture plane.
    pub(super) corner: [f64; 2],
}

impl Frame {
    pub(super) fn new(params: &RenderParams, camera: &Camera) -> Self {
        let size = [0, 1].map(|a| (camera.high[a] - camera.low[a]).max(1e-6));
        let title = if params.title.is_some() { TITLE } else { 0 };
        let (side, foot) = if params.legend { (LEGEND, FOOTER) } else { (0, 0) };
        let w = params.width.saturating_sub(2 * MARGIN + side).max(100);
        let natural = (f64::from(w) * size[1] / size[0]).clamp(f64::from(w) * 0.2, f64::from(w) * 1.2);
        let least = if params.legend { 280.0 } else { 60.0 };
        let h =
            params.height.map_or(natural.max(least) as u32, |h| h.saturating_sub(2 * MARGIN + title + foot).max(60));
        let unit = (size[0] / f64::from(w)).max(size[1] / f64::from(h)).max(1e-9) * 1.002;
        let middle = [0, 1].map(|a| 0.5 * (camera.low[a] + camera.high[a]));
        let corner = [middle[0] - 0.5 * f64::from(w) * unit, middle[1] - 0.5 * f64::from(h) * unit];
        let height = params.height.unwrap_or(h + 2 * MARGIN + title + foot);
        Self { width: params.width, height, x: MARGIN, y: MARGIN + title, w, h, unit, corner }
    }

    /// World file numbers of a map.
    pub(super) fn world(&self, camera: &Camera) -> [f64; 6] {
        let u = self.corner[0] + (0.5 - f64::from(self.x)) * self.unit;
        let v = self.corner[1] + (0.5 - f64::from(self.y)) * self.unit;
        let (x, y) = camera.map_place(u, v);
        [self.unit, 0.0, 0.0, -self.unit, x, y]
    }
}
