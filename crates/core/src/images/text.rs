//! Antialiased text in Ubuntu Light, the font that ships with `epaint_default_fonts`.

use super::canvas::Image;
use ab_glyph::{Font, FontRef, Glyph, ScaleFont, point};

fn font() -> Option<FontRef<'static>> {
    FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT).ok()
}

/// Glyphs of a line that starts at x = 0 on the baseline y = 0, and its width.
fn layout(font: &FontRef<'static>, size: f32, text: &str) -> (Vec<Glyph>, f32) {
    let scaled = font.as_scaled(size);
    let (mut glyphs, mut x, mut last) = (Vec::new(), 0.0, None);
    for c in text.chars() {
        let id = scaled.glyph_id(c);
        if let Some(last) = last {
            x += scaled.kern(last, id);
        }
        glyphs.push(id.with_scale_and_position(size, point(x, 0.0)));
        x += scaled.h_advance(id);
        last = Some(id);
    }
    (glyphs, x)
}

/// Width of a line in pixels.
pub(super) fn width(size: f32, text: &str) -> f32 {
    font().map_or(0.0, |font| layout(&font, size, text).1)
}

/// Size in pixels and colour of a text.
#[derive(Clone, Copy)]
pub(super) struct Style {
    pub(super) size: f32,
    pub(super) colour: [u8; 3],
}

/// Draws a line whose baseline starts at a position.
pub(super) fn draw(image: &mut Image, [x, y]: [f32; 2], Style { size, colour }: Style, text: &str) {
    let Some(font) = font() else { return };
    for glyph in layout(&font, size, text).0 {
        let Some(outline) = font.outline_glyph(glyph) else { continue };
        let bounds = outline.px_bounds();
        outline.draw(|u, v, coverage| {
            let place = [(x + bounds.min.x) as i64 + i64::from(u), (y + bounds.min.y) as i64 + i64::from(v)];
            // A light typeface on a light background is easier to read slightly darker.
            image.mix(place, colour, (coverage * 1.25).min(1.0));
        });
    }
}
