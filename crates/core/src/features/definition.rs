//! The registry of features: name, group, formula, range, unit, missing value and reach of each, once.
//!
//! The command line's `features --list`, Python's `features.definitions`, the page `docs/features.md`, the columns of
//! all feature tables and the feature names of model files come from here.

use serde::Serialize;

/// What one value describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// A point on one level of the pyramid: a value for each level, with the scale in its name.
    Level,
    /// A point in its cell of a grid in plan: a value for each cell size, which is in its name.
    Cell,
    /// A point in the spheres of a radius: a value for each radius, which is in its name.
    Radius,
    /// A point and a class: a value for each class, and for each size of surroundings, with both in its name.
    Class,
    /// A point.
    Point,
    /// A segment.
    Segment,
}

/// Source of a feature; a group is not computed if none of its features is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// Eigenvalues and eigenvectors of the structure tensor.
    Covariance,
    /// Moments along e2, and differences of normals and curvature across and along the edge.
    Contour,
    /// The vertical column around the point.
    Height,
    /// Heights in the point's cell of a grid in plan, and the surface of highest points around it.
    Profile,
    /// All points in spheres of several radii, each on a cloud that is thinned in proportion.
    Sphere,
    /// What a first classifier says about the surroundings.
    Context,
    /// The point's own colour.
    Colour,
    /// The point's own intensity.
    Intensity,
    /// The point's return number and number of returns.
    Returns,
    /// Eigenvalues and eigenvectors of the optimal neighbourhood.
    Optimal,
    /// Height above the road or ground, and position with respect to the road.
    Terrain,
    /// Eigenvalues and heights of the points of a segment.
    SegmentShape,
    /// Colours of the points of a segment.
    SegmentColour,
    /// Heights above the ground of the points of a segment.
    SegmentHeight,
    /// The clusters of the point on four levels, by their numbers.
    ClusterRank,
    /// The clusters of the point on four levels, by their shapes.
    ClusterDescriptor,
}

impl Group {
    /// All groups, in the order of the registry.
    pub const ALL: [Self; 16] = [
        Self::Covariance,
        Self::Contour,
        Self::Height,
        Self::Profile,
        Self::Sphere,
        Self::Context,
        Self::Colour,
        Self::Intensity,
        Self::Returns,
        Self::Optimal,
        Self::Terrain,
        Self::SegmentShape,
        Self::SegmentColour,
        Self::SegmentHeight,
        Self::ClusterRank,
        Self::ClusterDescriptor,
    ];

    /// The group's name in lists.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Covariance => "covariance",
            Self::Contour => "contour",
            Self::Height => "height",
            Self::Profile => "profile",
            Self::Sphere => "sphere",
            Self::Context => "context",
            Self::Colour => "colour",
            Self::Intensity => "intensity",
            Self::Returns => "returns",
            Self::Optimal => "optimal",
            Self::Terrain => "terrain",
            Self::SegmentShape => "segment-shape",
            Self::SegmentColour => "segment-colour",
            Self::SegmentHeight => "segment-height",
            Self::ClusterRank => "cluster-rank",
            Self::ClusterDescriptor => "cluster-descriptor",
        }
    }

    /// What one value of the group describes.
    pub const fn scope(self) -> Scope {
        match self {
            Self::Covariance | Self::Contour | Self::Height => Scope::Level,
            Self::Profile => Scope::Cell,
            Self::Sphere => Scope::Radius,
            Self::Context => Scope::Class,
            Self::Colour | Self::Intensity | Self::Returns | Self::Optimal | Self::Terrain => Scope::Point,
            Self::ClusterRank | Self::ClusterDescriptor => Scope::Point,
            Self::SegmentShape | Self::SegmentColour | Self::SegmentHeight => Scope::Segment,
        }
    }

    /// The points on which a value of the group depends.
    pub const fn reach(self) -> &'static str {
        match self {
            Self::Covariance => "the k nearest points of the level",
            Self::Contour => "the k nearest points of the level, and their k nearest",
            Self::Height => "the points of the level in a vertical column",
            Self::Profile => "the points of 5 x 5 cells in plan",
            Self::Sphere => "the points within the radius, of a cloud thinned to voxels of a share of it",
            Self::Context => "the probabilities of a first classifier in 3 x 3 x 3 voxels or 3 x 3 cells in plan",
            Self::Colour | Self::Returns => "the point",
            Self::Intensity => "the point, and the median of the cloud",
            Self::Optimal => "the k_min..k_max nearest points",
            Self::Terrain => "the road or ground points nearby",
            Self::SegmentShape | Self::SegmentColour | Self::SegmentHeight => "the points of the segment",
            Self::ClusterRank | Self::ClusterDescriptor => "the clusters of the point, and those that touch them",
        }
    }

    /// The group's features, in the order of their columns.
    pub fn definitions(self) -> impl Iterator<Item = &'static Definition> {
        ALL.iter().filter(move |d| d.group == self)
    }

    /// Names of the group's features, in the order of their columns.
    pub fn names(self) -> impl Iterator<Item = String> {
        self.definitions().map(|d| d.name.to_owned())
    }
}

/// One feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Definition {
    /// The feature's key.
    #[serde(skip)]
    pub feature: Feature,
    /// Name; features of a level have the scale appended, as in `Planarity_r0p4`. Unique within a [`Scope`].
    pub name: &'static str,
    /// Source of the feature.
    pub group: Group,
    /// Formula in the symbols of `docs/features.md`.
    pub formula: &'static str,
    /// Range of values.
    pub range: &'static str,
    /// Unit; `-` if it has none.
    pub unit: &'static str,
    /// Value where the formula has none (points that coincide, a side without points, a height that is not known); `-`
    /// if it always has one. Rows of points that are not finite, or stray, are NaN.
    pub missing: &'static str,
    /// The points on which a value depends.
    pub reach: &'static str,
}

/// Writes the key of each feature and its definition from one list, so that `ALL[feature as usize]` defines `feature`.
macro_rules! registry {
    ($($feature:ident $name:literal $group:ident: $formula:literal, $range:literal, $unit:literal, $missing:literal;)*) => {
        /// Key of a feature.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Feature {
            $(#[doc = concat!("`", $formula, "`")] $feature,)*
        }

        /// All features: those of a level (Hackel 2018, Table 4.1), of a cell in plan, of spheres (Thomas et al.
        /// 2018, Table 1), of the point itself, of its optimal neighbourhood
        /// (Guinard & Landrieu 2017, section 2.1), of the terrain (section 2.2), and of segments (Hasanpour Zaryabi et
        /// al. 2022, Table 3).
        pub const ALL: &[Definition] = &[
            $(Definition {
                feature: Feature::$feature,
                name: $name,
                group: Group::$group,
                formula: $formula,
                range: $range,
                unit: $unit,
                missing: $missing,
                reach: Group::$group.reach(),
            },)*
        ];
    };
}

// key, name, group: formula, range, unit, missing value.
registry! {
    Sum "Sum" Covariance: "l1 + l2 + l3", ">= 0", "m2", "0";
    Omnivariance "Omnivariance" Covariance: "(l1 l2 l3)^(1/3)", ">= 0", "m2", "0";
    Eigenentropy "Eigenentropy" Covariance: "-sum l ln(l), l in m2", "any", "m2", "0";
    Anisotropy "Anisotropy" Covariance: "(l1 - l3) / l1", "0..1", "-", "0";
    Planarity "Planarity" Covariance: "(l2 - l3) / l1", "0..1", "-", "0";
    Linearity "Linearity" Covariance: "(l1 - l2) / l1", "0..1", "-", "0";
    SurfaceVariation "SurfaceVariation" Covariance: "l3 / (l1 + l2 + l3)", "0..1/3", "-", "0";
    Sphericity "Sphericity" Covariance: "l3 / l1", "0..1", "-", "0";
    Verticality "Verticality" Covariance: "1 - |z . e3|", "0..1", "-", "0";
    FirstMoment "FirstMoment" Contour: "(sum d)^2 / sum d^2, d = (p_n - p) . e2", "0..k", "-", "0";
    SecondMoment "SecondMoment" Contour: "sum d^2", ">= 0", "m2", "-";
    SurfaceOrientation "SurfaceOrientation" Contour: "|med n over d < 0 . med n over d >= 0|", "0..1", "-", "1";
    LineFeature "LineFeature" Contour: "mean curvature near e1 / mean far from it", "0..1000", "-", "1";
    VerticalRange "VerticalRange" Height: "z max - z min in the column", ">= 0", "m", "-";
    HeightBelow "HeightBelow" Height: "z - z min in the column", ">= 0", "m", "-";
    HeightAbove "HeightAbove" Height: "z max - z in the column", ">= 0", "m", "-";
    ProfileRank "ProfileRank" Profile: "share of the cell's heights below z", "0..1", "-", "NaN";
    GapBelow "GapBelow" Profile: "z - next height below in the cell", ">= 0", "m", "0";
    GapAbove "GapAbove" Profile: "next height above in the cell - z", ">= 0", "m", "0";
    ProfileAbove "ProfileAbove" Profile: "highest in the cell - z", "any", "m", "NaN";
    ProfileBelow "ProfileBelow" Profile: "z - lowest in the cell", "any", "m", "NaN";
    ProfileMedian "ProfileMedian" Profile: "z - median of the cell", "any", "m", "NaN";
    ProfileDeviation "ProfileDeviation" Profile: "standard deviation of the cell's heights", ">= 0", "m", "NaN";
    ProfileLow "ProfileLow" Profile: "z - 10 % quantile of the cell", "any", "m", "NaN";
    ProfileHigh "ProfileHigh" Profile: "90 % quantile of the cell - z", "any", "m", "NaN";
    LargestGap "LargestGap" Profile: "largest difference of successive heights in the cell", ">= 0", "m", "NaN";
    SurfaceAbove3 "SurfaceAbove3" Profile: "highest in 3 x 3 cells - z", "any", "m", "NaN";
    SurfaceBelow3 "SurfaceBelow3" Profile: "z - lowest in 3 x 3 cells", "any", "m", "NaN";
    SurfaceRange3 "SurfaceRange3" Profile: "highest - lowest in 3 x 3 cells", ">= 0", "m", "NaN";
    SurfaceRoughness3 "SurfaceRoughness3" Profile: "rms of the cells' highest points to their plane, 3 x 3 cells", ">= 0", "m", "NaN";
    SurfaceSlope3 "SurfaceSlope3" Profile: "slope of that plane", ">= 0", "-", "NaN";
    SurfaceMean3 "SurfaceMean3" Profile: "z - mean of the highest points of 3 x 3 cells", "any", "m", "NaN";
    SurfaceAbove5 "SurfaceAbove5" Profile: "highest in 5 x 5 cells - z", "any", "m", "NaN";
    SurfaceBelow5 "SurfaceBelow5" Profile: "z - lowest in 5 x 5 cells", "any", "m", "NaN";
    SurfaceRange5 "SurfaceRange5" Profile: "highest - lowest in 5 x 5 cells", ">= 0", "m", "NaN";
    SurfaceRoughness5 "SurfaceRoughness5" Profile: "rms of the cells' highest points to their plane, 5 x 5 cells", ">= 0", "m", "NaN";
    SurfaceSlope5 "SurfaceSlope5" Profile: "slope of that plane", ">= 0", "-", "NaN";
    SurfaceMean5 "SurfaceMean5" Profile: "z - mean of the highest points of 5 x 5 cells", "any", "m", "NaN";
    LeastRoughness3 "LeastRoughness3" Profile: "least SurfaceRoughness3 of 3 x 3 cells", ">= 0", "m", "NaN";
    SurfaceCover5 "SurfaceCover5" Profile: "share of 5 x 5 cells with points", "0..1", "-", "NaN";
    SphereSum "SphereSum" Sphere: "l1 + l2 + l3", ">= 0", "m2", "0";
    SphereOmnivariance "SphereOmnivariance" Sphere: "(l1 l2 l3)^(1/3)", ">= 0", "m2", "0";
    SphereEigenentropy "SphereEigenentropy" Sphere: "-sum l ln(l), l in m2", "any", "m2", "0";
    SphereLinearity "SphereLinearity" Sphere: "(l1 - l2) / l1", "0..1", "-", "0";
    SpherePlanarity "SpherePlanarity" Sphere: "(l2 - l3) / l1", "0..1", "-", "0";
    SphereSphericity "SphereSphericity" Sphere: "l3 / l1", "0..1", "-", "0";
    SphereSurfaceVariation "SphereSurfaceVariation" Sphere: "l3 / (l1 + l2 + l3)", "0..1/3", "-", "0";
    SphereVerticality1 "SphereVerticality1" Sphere: "|pi/2 - angle(e1, z)|", "0..pi/2", "rad", "0";
    SphereVerticality3 "SphereVerticality3" Sphere: "|pi/2 - angle(e3, z)|", "0..pi/2", "rad", "0";
    SphereMomentE1 "SphereMomentE1" Sphere: "|mean (p_n - p) . e1|", ">= 0", "m", "0";
    SphereMomentE2 "SphereMomentE2" Sphere: "|mean (p_n - p) . e2|", ">= 0", "m", "0";
    SphereMomentE3 "SphereMomentE3" Sphere: "|mean (p_n - p) . e3|", ">= 0", "m", "0";
    SphereSecondMomentE1 "SphereSecondMomentE1" Sphere: "mean ((p_n - p) . e1)^2", ">= 0", "m2", "0";
    SphereSecondMomentE2 "SphereSecondMomentE2" Sphere: "mean ((p_n - p) . e2)^2", ">= 0", "m2", "0";
    SphereSecondMomentE3 "SphereSecondMomentE3" Sphere: "mean ((p_n - p) . e3)^2", ">= 0", "m2", "0";
    SphereMomentZ "SphereMomentZ" Sphere: "mean (p_n - p) . z", "any", "m", "-";
    SphereSecondMomentZ "SphereSecondMomentZ" Sphere: "mean ((p_n - p) . z)^2", ">= 0", "m2", "-";
    SphereCount "SphereCount" Sphere: "number of points", ">= 1", "-", "-";
    ContextOwn "Own" Context: "p of the point", "0..1", "-", "-";
    ContextVoxel "Voxel" Context: "mean p in 3 x 3 x 3 voxels", "0..1", "-", "-";
    ContextCell "Cell" Context: "mean p in 3 x 3 cells in plan", "0..1", "-", "-";
    ContextBelow "Below" Context: "mean p of the points of the cell that are not above the point", "0..1", "-", "-";
    ContextAbove "Above" Context: "mean p of the points of the cell that are not below the point", "0..1", "-", "-";
    ContextTop "Top" Context: "mean p of the highest points of the cell", "0..1", "-", "-";
    BandMost "BandMost" Context: "largest p in 3 x 3 x 3 voxels", "0..1", "-", "NaN";
    BandLength "BandLength" Context: "sqrt(l1) / edge, of the points in 3 x 3 x 3 voxels with weights p", ">= 0", "-", "NaN";
    BandWidth "BandWidth" Context: "sqrt(l2) / edge, of the same points", ">= 0", "-", "NaN";
    BandThickness "BandThickness" Context: "sqrt(l3) / edge, of the same points", ">= 0", "-", "NaN";
    BandAcross "BandAcross" Context: "distance of the point from the line through their weighted mean along e1 / edge", ">= 0", "-", "NaN";
    BandOffset "BandOffset" Context: "distance of the point from their weighted mean / edge", ">= 0", "-", "NaN";
    BandShare "BandShare" Context: "p of the point / BandMost", "0..1", "-", "NaN";
    Red "Red" Colour: "red / largest value of the type", "0..1", "-", "-";
    Green "Green" Colour: "green / largest value of the type", "0..1", "-", "-";
    Blue "Blue" Colour: "blue / largest value of the type", "0..1", "-", "-";
    RelativeIntensity "RelativeIntensity" Intensity: "intensity / (intensity + median)", "0..1", "-", "0";
    ReturnNumber "ReturnNumber" Returns: "number of the return in its pulse", ">= 0", "-", "-";
    NumberOfReturns "NumberOfReturns" Returns: "returns of the pulse", ">= 0", "-", "-";
    ReturnRatio "ReturnRatio" Returns: "return number / number of returns", "0..1", "-", "0";
    OptimalLinearity "OptimalLinearity" Optimal: "(l1 - l2) / l1", "0..1", "-", "0";
    OptimalPlanarity "OptimalPlanarity" Optimal: "(l2 - l3) / l1", "0..1", "-", "0";
    OptimalScattering "OptimalScattering" Optimal: "l3 / l1", "0..1", "-", "0";
    OptimalVerticality "OptimalVerticality" Optimal: "v . z / |v|, v = sum l |e|", "0..factor", "-", "0";
    Elevation "Elevation" Terrain: "z - ground(x, y)", "any", "m", "-";
    RoadPosition "RoadPosition" Terrain: "0.5 near the border of the road, else 0 inside, 1 outside", "0, 0.5, 1", "-", "-";
    SegmentLinearity "Linearity" SegmentShape: "(e1 - e2) / e1", "0..1", "-", "0";
    SegmentPlanarity "Planarity" SegmentShape: "(e2 - e3) / e1", "0..1", "-", "0";
    SegmentScattering "Scattering" SegmentShape: "e3 / e1", "0..1", "-", "0";
    SegmentLocalCurvature "LocalCurvature" SegmentShape: "e3", "0..1/3", "-", "0";
    SegmentOmnivariance "Omnivariance" SegmentShape: "(e1 e2 e3)^(1/3)", "0..1/3", "-", "0";
    SegmentAnisotropy "Anisotropy" SegmentShape: "(e1 - e3) / e1", "0..1", "-", "0";
    SegmentEigenentropy "Eigenentropy" SegmentShape: "-sum e ln(e)", "0..ln 3", "-", "0";
    SegmentMeanZ "MeanZ" SegmentShape: "mean z", "any", "m", "-";
    SegmentVarianceZ "VarianceZ" SegmentShape: "mean (z - mean z)^2", ">= 0", "m2", "-";
    SegmentMeanRed "MeanRed" SegmentColour: "mean red", "0..1", "-", "-";
    SegmentMeanGreen "MeanGreen" SegmentColour: "mean green", "0..1", "-", "-";
    SegmentMeanBlue "MeanBlue" SegmentColour: "mean blue", "0..1", "-", "-";
    SegmentRedRatio "RedRatio" SegmentColour: "mean red / sum of the three means", "0..1", "-", "0";
    SegmentGreenRatio "GreenRatio" SegmentColour: "mean green / sum of the three means", "0..1", "-", "0";
    SegmentBlueRatio "BlueRatio" SegmentColour: "mean blue / sum of the three means", "0..1", "-", "0";
    SegmentRedRange "RedRange" SegmentColour: "red max - red min", "0..1", "-", "-";
    SegmentGreenRange "GreenRange" SegmentColour: "green max - green min", "0..1", "-", "-";
    SegmentBlueRange "BlueRange" SegmentColour: "blue max - blue min", "0..1", "-", "-";
    SegmentMeanHeight "MeanHeight" SegmentHeight: "mean height above ground", "any", "m", "NaN";
    SegmentMaxHeight "MaxHeight" SegmentHeight: "largest height above ground", "any", "m", "NaN";
    ClusterRank1 "ClusterL1" ClusterRank: "rank by size of the segment / number of segments", "0..1", "-", "0";
    ClusterRank2 "ClusterL2" ClusterRank: "rank by size of the merged segment / number of these", "0..1", "-", "0";
    ClusterCategory "ClusterL3" ClusterRank: "rank by height of the category / number of categories", "0..1", "-", "0";
    ClusterCentral "ClusterL4" ClusterRank: "centrality, mean of three levels", "0..1", "-", "0";
    ClusterSize1 "ClusterSizeL1" ClusterDescriptor: "log10 of the points of the segment", ">= 0", "-", "0";
    ClusterPlanarity1 "ClusterPlanarityL1" ClusterDescriptor: "(l2 - l3) / l1 of the segment", "0..1", "-", "0";
    ClusterVerticality1 "ClusterVerticalityL1" ClusterDescriptor: "1 - |z . e3| of the segment", "0..1", "-", "0";
    ClusterSize2 "ClusterSizeL2" ClusterDescriptor: "log10 of the points of the merged segment", ">= 0", "-", "0";
    ClusterPlanarity2 "ClusterPlanarityL2" ClusterDescriptor: "(l2 - l3) / l1 of the merged segment", "0..1", "-", "0";
    ClusterVerticality2 "ClusterVerticalityL2" ClusterDescriptor: "1 - |z . e3| of the merged segment", "0..1", "-", "0";
    ClusterHeight "ClusterHeightL3" ClusterDescriptor: "mean height of the category", "any", "m", "0";
    ClusterCentrality "ClusterCentralityL4" ClusterDescriptor: "centrality, mean of three levels", "0..1", "-", "0";
}

impl Feature {
    /// The feature's definition.
    pub fn definition(self) -> &'static Definition {
        &ALL[self as usize]
    }

    /// The feature of this column name; those of a level with their scale, as in `Planarity_r0p4`, those of a class with
    /// its code too, as in `Voxel_6_r0p5`.
    pub fn named(name: &str, scope: Scope) -> Option<Self> {
        let base = match scope {
            Scope::Level | Scope::Cell | Scope::Radius => name.rsplit_once("_r")?.0,
            Scope::Class => name.split_once('_')?.0,
            Scope::Point | Scope::Segment => name,
        };
        ALL.iter().find(|d| d.group.scope() == scope && d.name == base).map(|d| d.feature)
    }
}

/// All features of a scope, in the order of their columns.
pub fn of_scope(scope: Scope) -> impl Iterator<Item = &'static Definition> {
    ALL.iter().filter(move |d| d.group.scope() == scope)
}

/// Name of a feature at a scale: the scale in metres with `p` for the decimal point, as in `Planarity_r0p4`.
pub fn scaled_name(feature: &Definition, scale: f64) -> String {
    format!("{}_r{}", feature.name, scale_text(scale))
}

/// Name of a feature for the class of a code, in surroundings of a size if it has one, as in `Voxel_6_r0p5`.
pub fn class_name(feature: &Definition, code: u8, size: Option<f64>) -> String {
    let size = size.map(|size| format!("_r{}", scale_text(size)));
    format!("{}_{code}{}", feature.name, size.unwrap_or_default())
}

/// A scale in metres with `p` for the decimal point, as in `0p4`.
fn scale_text(scale: f64) -> String {
    let mut scale = format!("{scale:.4}");
    scale.truncate(scale.trim_end_matches('0').trim_end_matches('.').len());
    scale.replace('.', "p")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_within_a_scope_short_and_plain() {
        for scope in [Scope::Level, Scope::Cell, Scope::Radius, Scope::Class, Scope::Point, Scope::Segment] {
            let mut names: Vec<String> = of_scope(scope).map(|d| scaled_name(d, 1638.4)).collect();
            assert!(names.iter().all(|n| n.len() <= 31 && n.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')));
            names.sort();
            names.dedup();
            assert_eq!(names.len(), of_scope(scope).count());
        }
        let planarity = Feature::Planarity.definition();
        assert_eq!(scaled_name(planarity, 0.4), "Planarity_r0p4");
        assert_eq!(scaled_name(planarity, 0.025), "Planarity_r0p025");
        assert_eq!(scaled_name(planarity, 64.0), "Planarity_r64");
    }

    #[test]
    fn keys_and_names_find_their_definitions() {
        for definition in ALL {
            assert_eq!(definition.feature.definition(), definition);
            let scope = definition.group.scope();
            let name = match scope {
                Scope::Level | Scope::Cell | Scope::Radius => scaled_name(definition, 0.4),
                Scope::Class => class_name(definition, 6, Some(0.4)),
                Scope::Point | Scope::Segment => definition.name.to_owned(),
            };
            assert_eq!(Feature::named(&name, scope), Some(definition.feature));
        }
        assert_eq!(Feature::named("Planarity", Scope::Level), None);
        assert_eq!(Feature::named("Planarity", Scope::Segment), Some(Feature::SegmentPlanarity));
        assert_eq!(Feature::named("Roughness_r1", Scope::Level), None);
    }

    #[test]
    fn groups_stand_together_in_their_order() {
        let grouped: Vec<&Definition> = Group::ALL.into_iter().flat_map(Group::definitions).collect();
        assert_eq!(grouped, ALL.iter().collect::<Vec<_>>());
        let counts = Group::ALL.map(|group| group.definitions().count());
        assert_eq!(counts, [9, 4, 3, 24, 18, 13, 3, 1, 3, 4, 2, 9, 9, 2, 4, 8]);
    }
}
