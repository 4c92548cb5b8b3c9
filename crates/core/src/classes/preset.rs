//! Well-known class tables, one file each in `assets/classes`.

use super::{Class, ClassTable};
use crate::cloud::{ClassNames, CodeScheme, OwnClass};
use crate::error::{Error, Result};
use serde::Deserialize;
use std::sync::LazyLock;

/// A class table as a person writes it: TOML with a list `classes` of code, name and, if wished, colour.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    classes: Vec<WrittenClass>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenClass {
    code: u8,
    name: String,
    colour: Option<[u8; 3]>,
}

/// Reads a class table: `classes = [{ code = 64, name = "tram", colour = [255, 0, 0] }, ...]`; without a colour a class
/// has that of its code.
///
/// # Errors
/// If the text is not such a table, or a code occurs twice.
pub fn from_toml(text: &str) -> Result<ClassTable> {
    let written: Written = toml::from_str(text).map_err(|e| Error::input(format!("class table: {e}")))?;
    let class = |WrittenClass { code, name, colour }| Class { code, name, colour: colour.unwrap_or(colour_of(code)) };
    ClassTable::new(written.classes.into_iter().map(class).collect())
}

macro_rules! tables {
    ($($name:ident = $file:literal;)*) => {
        $(static $name: LazyLock<ClassTable> =
            LazyLock::new(|| from_toml(include_str!(concat!("../../assets/classes/", $file))).unwrap_or_default());)*
    };
}

tables! {
    ASPRS = "asprs.toml";
    SEMANTIC3D = "semantic3d.toml";
    S3DIS = "s3dis.toml";
    SEMANTIC_KITTI = "semantickitti.toml";
    TORONTO_3D = "toronto-3d.toml";
    PARIS_LILLE_3D = "paris-lille-3d.toml";
}

/// All classes of a list; none if it is not known.
pub fn table(scheme: CodeScheme) -> &'static ClassTable {
    static NONE: LazyLock<ClassTable> = LazyLock::new(ClassTable::default);
    match scheme {
        CodeScheme::Own => &NONE,
        CodeScheme::Asprs => &ASPRS,
        CodeScheme::Semantic3d => &SEMANTIC3D,
        CodeScheme::S3dis => &S3DIS,
        CodeScheme::SemanticKitti => &SEMANTIC_KITTI,
        CodeScheme::Toronto3d => &TORONTO_3D,
        CodeScheme::ParisLille3d => &PARIS_LILLE_3D,
    }
}

/// The ASPRS class with that code (LAS 1.4 R15, table 17); codes outside the list are named `class N`.
pub fn asprs(code: u8) -> Class {
    class(code, CodeScheme::Asprs)
}

/// The class with that code in a list, named `class N` if the list does not have it. Codes of an unknown list have the
/// colours of the ASPRS list.
pub fn class(code: u8, scheme: CodeScheme) -> Class {
    let find = |table: &ClassTable| table.position(code).map(|at| table.classes()[at].clone());
    find(table(scheme)).unwrap_or_else(|| {
        let colour = match scheme {
            CodeScheme::Own => find(&ASPRS).map_or_else(|| colour_of(code), |class| class.colour),
            _ => colour_of(code),
        };
        Class { code, name: format!("class {code}"), colour }
    })
}

/// The class with that code: its own name and colour if it has any, else as in the list.
pub fn named(code: u8, scheme: CodeScheme, own: &ClassNames) -> Class {
    let known = class(code, scheme);
    // The record of LAS has room for 15 bytes.
    let cut = |own: &OwnClass| own.name.len() == 15 && known.name.starts_with(&own.name);
    match own.get(&code).filter(|own| !cut(own)) {
        Some(own) => Class { name: own.name.clone(), colour: own.colour.unwrap_or(known.colour), ..known },
        None => known,
    }
}

/// A colour for a code without one: hues turn by the golden angle from code to code, so that neighbours differ, in three
/// degrees of lightness.
pub fn colour_of(code: u8) -> [u8; 3] {
    let hue = (f64::from(code) * 137.508).rem_euclid(360.0) / 60.0;
    let value = [1.0, 0.72, 0.5][usize::from(code) % 3];
    let saturation = if code.is_multiple_of(2) { 0.85 } else { 0.55 };
    let channel = |shift: f64| {
        let place = (shift + hue).rem_euclid(6.0);
        let part = place.min(4.0 - place).clamp(0.0, 1.0);
        (255.0 * value * (1.0 - saturation * part)).round() as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_list_is_read_and_has_its_well_known_names() {
        for (scheme, classes, code, name) in [
            (CodeScheme::Asprs, 23, 6, "building"),
            (CodeScheme::Semantic3d, 8, 8, "cars"),
            (CodeScheme::S3dis, 13, 8, "chair"),
            (CodeScheme::SemanticKitti, 30, 80, "pole"),
            (CodeScheme::Toronto3d, 9, 6, "pole"),
            (CodeScheme::ParisLille3d, 10, 4, "bollard"),
            (CodeScheme::Own, 0, 15, "class 15"),
        ] {
            assert_eq!((table(scheme).len(), class(code, scheme).name.as_str()), (classes, name));
        }
        assert_eq!(class(200, CodeScheme::Toronto3d).name, "class 200");
    }

    #[test]
    fn own_names_come_first_and_keep_the_colour_of_the_list() {
        let own = ClassNames::from([(15, OwnClass { name: "pole".into(), colour: None })]);
        let pole = named(15, CodeScheme::Asprs, &own);
        assert_eq!((pole.name.as_str(), pole.colour), ("pole", asprs(15).colour));
        assert_eq!(named(6, CodeScheme::Asprs, &own), asprs(6));
        let cut = ClassNames::from([(4, OwnClass { name: "medium vegetati".into(), colour: None })]);
        assert_eq!(named(4, CodeScheme::Asprs, &cut).name, "medium vegetation");
    }

    #[test]
    fn written_tables_may_leave_colours_out_and_faults_are_named() {
        let table = from_toml("classes = [{ code = 64, name = \"tram\" }]").unwrap();
        assert_eq!((table.classes()[0].name.as_str(), table.classes()[0].colour), ("tram", colour_of(64)));
        for (text, part) in [
            ("classes = [{ code = 300, name = \"a\" }]", "300"),
            ("classes = [{ code = 3, title = \"a\" }]", "title"),
            ("classes = [{ code = 3, name = \"a\" }, { code = 3, name = \"b\" }]", "twice"),
            ("a = 1", "class table"),
        ] {
            assert!(from_toml(text).unwrap_err().to_string().contains(part), "{text}");
        }
    }

    /// A distance that follows the eye: <https://www.compuphase.com/cmetric.htm>.
    fn distance(a: [u8; 3], b: [u8; 3]) -> f64 {
        let [ar, ag, ab] = a.map(f64::from);
        let [br, bg, bb] = b.map(f64::from);
        let red = (ar + br) / 512.0;
        ((2.0 + red) * (ar - br).powi(2) + 4.0 * (ag - bg).powi(2) + (3.0 - red) * (ab - bb).powi(2)).sqrt()
    }

    #[test]
    fn unknown_codes_have_colours_that_can_be_told_apart() {
        let least = |codes: &[u8]| {
            let pairs = codes.iter().flat_map(|&a| codes.iter().filter(move |&&b| b > a).map(move |&b| (a, b)));
            pairs.map(|(a, b)| distance(colour_of(a), colour_of(b))).fold(f64::INFINITY, f64::min)
        };
        assert!(least(&(65..97).collect::<Vec<_>>()) > 40.0, "{}", least(&(65..97).collect::<Vec<_>>()));
        for first in 23..240 {
            let near: Vec<u8> = (first..first + 8).collect();
            assert!(least(&near) > 60.0, "{first}: {}", least(&near));
        }
    }
}
