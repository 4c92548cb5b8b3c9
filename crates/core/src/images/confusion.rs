//! A confusion matrix as a picture: rows are true classes, cells show percent of the row.

use super::canvas::{INK, Image};
use super::text::{self, Style};
use crate::evaluation::Confusion;

const CELL: i64 = 86;
const LEFT: i64 = 250;
const TOP: i64 = 130;

/// Draws the matrix; a darker cell has a larger share of the true class.
pub fn confusion_picture(confusion: &Confusion) -> Image {
    let classes = confusion.classes().classes();
    let n = classes.len() as i64;
    let mut image = Image::blank((LEFT + n.max(3) * CELL + 40) as u32, (TOP + n * CELL + 40) as u32);
    text::draw(
        &mut image,
        [24.0, 42.0],
        Style { size: 24.0, colour: INK },
        "Confusion: row = true class, column = named so, percent of the row",
    );
    for (i, class) in (0..).zip(classes) {
        let middle = (TOP + i * CELL + CELL / 2) as f32;
        image.rectangle([24, middle as i64 - 11], [22, 22], class.colour);
        text::draw(
            &mut image,
            [56.0, middle + 6.0],
            Style { size: 18.0, colour: INK },
            &format!("{} {}", class.code, class.name),
        );
        let code = class.code.to_string();
        let x = (LEFT + i * CELL + CELL / 2) as f32 - 0.5 * text::width(18.0, &code);
        text::draw(&mut image, [x, TOP as f32 - 14.0], Style { size: 18.0, colour: INK }, &code);
    }
    for t in 0..classes.len() {
        for p in 0..classes.len() {
            let share = confusion.count(t, p) as f32 / confusion.support(t).max(1) as f32;
            Cell { column: p as i64, row: t as i64, count: confusion.count(t, p), share }.draw(&mut image);
        }
    }
    image
}

/// A cell of the matrix: true class `row`, predicted class `column`.
struct Cell {
    column: i64,
    row: i64,
    count: u64,
    /// Share of the true class, 0..=1.
    share: f32,
}

impl Cell {
    fn draw(&self, image: &mut Image) {
        let Self { column, row, count, share } = *self;
        let full: [f32; 3] = if column == row { [25.0, 101.0, 84.0] } else { [178.0, 34.0, 52.0] };
        let strength = share.sqrt();
        let colour = full.map(|c| (246.0 + (c - 246.0) * strength) as u8);
        let (x, y) = (LEFT + column * CELL, TOP + row * CELL);
        image.rectangle([x + 1, y + 1], [CELL - 2, CELL - 2], colour);
        let ink = if strength > 0.62 { [255, 255, 255] } else { INK };
        let percent = format!("{:.1}", 100.0 * share);
        let middle = |size: f32, text: &str| x as f32 + 0.5 * (CELL as f32 - text::width(size, text));
        text::draw(image, [middle(20.0, &percent), y as f32 + 42.0], Style { size: 20.0, colour: ink }, &percent);
        let count = count.to_string();
        text::draw(image, [middle(13.0, &count), y as f32 + 64.0], Style { size: 13.0, colour: ink }, &count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_cells_are_green_and_wrong_ones_red() {
        let confusion = Confusion::from_labels(&[2, 2, 6, 6], &[2, 2, 2, 2], &[]).unwrap();
        let image = confusion_picture(&confusion);
        let at = |column: i64, row: i64| {
            let place = 3 * ((TOP + row * CELL + 4) * i64::from(image.width) + LEFT + column * CELL + 4) as usize;
            [image.rgb[place], image.rgb[place + 1], image.rgb[place + 2]]
        };
        assert_eq!(at(0, 0), [25, 101, 84]);
        assert_eq!(at(0, 1), [178, 34, 52]);
        assert_eq!(at(1, 0), [246, 246, 246]);
    }
}
