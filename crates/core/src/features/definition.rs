//! The table of features: name, group, formula, range. Command line, Python and docs are generated from it.

use serde::Serialize;

/// Source of a feature; a group of a level is not computed if none of its features is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Group {
    /// Eigenvalues and eigenvectors of the structure tensor.
    Covariance,
    /// Moments along e2, and differences of normals and curvature across and along the edge.
    Contour,
    /// The vertical column around the point.
    Height,
    /// The point's own colour.
    Colour,
    /// The point's own intensity.
    Intensity,
    /// The point's return number and number of returns.
    Returns,
}

impl Group {
    /// The group's name in lists.
    pub fn name(self) -> &'static str {
        match self {
            Self::Covariance => "covariance",
            Self::Contour => "contour",
            Self::Height => "height",
            Self::Colour => "colour",
            Self::Intensity => "intensity",
            Self::Returns => "returns",
        }
    }
}

/// One feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Definition {
    /// Name; features of a level have the scale appended, as in `Planarity_r0p4`.
    pub name: &'static str,
    /// Source of the feature.
    pub group: Group,
    /// Formula in the symbols of `docs/pyramid.md`.
    pub formula: &'static str,
    /// Range of values.
    pub range: &'static str,
}

const fn row(name: &'static str, group: Group, formula: &'static str, range: &'static str) -> Definition {
    Definition { name, group, formula, range }
}

/// Features of one level of the pyramid.
pub const PER_LEVEL: usize = 16;

/// All features: first the 16 of a level (Hackel 2018, Table 4.1), then those of the point itself.
pub const ALL: &[Definition] = &[
    row("Sum", Group::Covariance, "l1 + l2 + l3", ">= 0, square metres"),
    row("Omnivariance", Group::Covariance, "(l1 l2 l3)^(1/3)", ">= 0, square metres"),
    row("Eigenentropy", Group::Covariance, "-sum l ln(l)", "any; metres"),
    row("Anisotropy", Group::Covariance, "(l1 - l3) / l1", "0..1"),
    row("Planarity", Group::Covariance, "(l2 - l3) / l1", "0..1"),
    row("Linearity", Group::Covariance, "(l1 - l2) / l1", "0..1"),
    row("SurfaceVariation", Group::Covariance, "l3 / (l1 + l2 + l3)", "0..1/3"),
    row("Sphericity", Group::Covariance, "l3 / l1", "0..1"),
    row("Verticality", Group::Covariance, "1 - |z . e3|", "0..1"),
    row("FirstMoment", Group::Contour, "(sum d)^2 / sum d^2, d = (p_n - p) . e2", "0..k"),
    row("SecondMoment", Group::Contour, "sum d^2", ">= 0, square metres"),
    row("SurfaceOrientation", Group::Contour, "|med n over d < 0 . med n over d >= 0|", "0..1"),
    row("LineFeature", Group::Contour, "mean curvature near e1 / mean far from it", "0..1000"),
    row("VerticalRange", Group::Height, "z max - z min in the column", ">= 0, metres"),
    row("HeightBelow", Group::Height, "z - z min in the column", ">= 0, metres"),
    row("HeightAbove", Group::Height, "z max - z in the column", ">= 0, metres"),
    row("Red", Group::Colour, "red / largest value of the type", "0..1"),
    row("Green", Group::Colour, "green / largest value of the type", "0..1"),
    row("Blue", Group::Colour, "blue / largest value of the type", "0..1"),
    row("RelativeIntensity", Group::Intensity, "intensity / (intensity + median)", "0..1"),
    row("ReturnNumber", Group::Returns, "number of the return in its pulse", ">= 0"),
    row("NumberOfReturns", Group::Returns, "returns of the pulse", ">= 0"),
    row("ReturnRatio", Group::Returns, "return number / number of returns", "0..1"),
];

/// Name of a feature at a scale: the scale in metres with `p` for the decimal point, as in `Planarity_r0p4`.
pub fn scaled_name(feature: &Definition, scale: f64) -> String {
    let mut scale = format!("{scale:.4}");
    scale.truncate(scale.trim_end_matches('0').trim_end_matches('.').len());
    format!("{}_r{}", feature.name, scale.replace('.', "p"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_short_and_plain() {
        let mut names: Vec<String> = ALL.iter().map(|d| scaled_name(d, 1638.4)).collect();
        assert!(names.iter().all(|n| n.len() <= 31 && n.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')));
        names.sort();
        names.dedup();
        assert_eq!(names.len(), ALL.len());
        assert_eq!(scaled_name(&ALL[4], 0.4), "Planarity_r0p4");
        assert_eq!(scaled_name(&ALL[4], 0.025), "Planarity_r0p025");
        assert_eq!(scaled_name(&ALL[4], 64.0), "Planarity_r64");
    }

    #[test]
    fn a_level_has_sixteen_features_in_three_groups() {
        let level = &ALL[..PER_LEVEL];
        let count = |group| level.iter().filter(|d| d.group == group).count();
        assert_eq!([Group::Covariance, Group::Contour, Group::Height].map(count), [9, 4, 3]);
    }
}
