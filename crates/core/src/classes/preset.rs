//! Well-known class tables: ASPRS, Semantic3D, Oakland.

use super::{Class, ClassTable};
use crate::cloud::CodeScheme;

const ASPRS: [(u8, &str, [u8; 3]); 19] = [
    (0, "never classified", [150, 150, 150]),
    (1, "unclassified", [187, 187, 187]),
    (2, "ground", [166, 118, 29]),
    (3, "low vegetation", [178, 223, 138]),
    (4, "medium vegetation", [102, 166, 30]),
    (5, "high vegetation", [27, 120, 55]),
    (6, "building", [215, 48, 39]),
    (7, "low noise", [231, 41, 138]),
    (8, "model key point", [99, 99, 99]),
    (9, "water", [55, 126, 184]),
    (10, "rail", [90, 60, 120]),
    (11, "road surface", [115, 115, 115]),
    (13, "wire guard", [253, 191, 111]),
    (14, "wire conductor", [255, 217, 47]),
    (15, "transmission tower", [117, 112, 179]),
    (16, "wire connector", [255, 127, 0]),
    (17, "bridge deck", [244, 165, 130]),
    (18, "high noise", [247, 104, 161]),
    (64, "vehicle", [141, 80, 200]),
];

/// The ASPRS class with that code (LAS 1.4 R15, table 17); codes outside the list are named `class N`.
pub fn asprs(code: u8) -> Class {
    match ASPRS.iter().find(|(c, _, _)| *c == code) {
        Some(&(code, name, colour)) => Class { code, name: name.into(), colour },
        None => Class { code, name: format!("class {code}"), colour: hashed_colour(code) },
    }
}

/// The class with that code in a list; named `class N` if the list is unknown or does not have the code.
pub fn class(code: u8, scheme: CodeScheme) -> Class {
    let unnamed = || Class { name: format!("class {code}"), ..asprs(code) };
    match scheme {
        CodeScheme::Asprs => asprs(code),
        CodeScheme::Semantic3d => {
            semantic3d().classes().iter().find(|c| c.code == code).cloned().unwrap_or_else(unnamed)
        }
        CodeScheme::Own => unnamed(),
    }
}

/// The eight classes of Semantic3D (Hackel et al. 2017); 0 is unlabelled and not in the table.
pub fn semantic3d() -> ClassTable {
    const CLASSES: [(&str, [u8; 3]); 8] = [
        ("man-made terrain", [200, 200, 200]),
        ("natural terrain", [166, 118, 29]),
        ("high vegetation", [27, 120, 55]),
        ("low vegetation", [178, 223, 138]),
        ("buildings", [215, 48, 39]),
        ("hard scape", [117, 112, 179]),
        ("scanning artefacts", [231, 41, 138]),
        ("cars", [55, 126, 184]),
    ];
    let classes = CLASSES.iter().zip(1..).map(|(&(name, colour), code)| Class { code, name: name.into(), colour });
    ClassTable { classes: classes.collect() }
}

fn hashed_colour(code: u8) -> [u8; 3] {
    let h = u32::from(code).wrapping_mul(2_654_435_761);
    [(h >> 24) as u8 | 64, (h >> 16) as u8 | 64, (h >> 8) as u8 | 64]
}
