//! Column names of other programs, translated to PDAL's names.

use crate::cloud::names;

/// Names used by other programs, in lower case and without `_`, with PDAL's name.
const KNOWN: [(&str, &str); 33] = [
    ("intensity", names::INTENSITY),
    ("i", names::INTENSITY),
    ("red", names::COLOUR[0]),
    ("r", names::COLOUR[0]),
    ("green", names::COLOUR[1]),
    ("g", names::COLOUR[1]),
    ("blue", names::COLOUR[2]),
    ("b", names::COLOUR[2]),
    ("class", names::CLASSIFICATION),
    ("classification", names::CLASSIFICATION),
    ("label", names::CLASSIFICATION),
    ("returnnumber", names::RETURN_NUMBER),
    ("numberofreturns", names::NUMBER_OF_RETURNS),
    ("scandirectionflag", "ScanDirectionFlag"),
    ("edgeofflightline", "EdgeOfFlightLine"),
    ("synthetic", "Synthetic"),
    ("syntheticflag", "Synthetic"),
    ("keypoint", "KeyPoint"),
    ("keypointflag", "KeyPoint"),
    ("withheld", "Withheld"),
    ("withheldflag", "Withheld"),
    ("overlap", "Overlap"),
    ("overlapflag", "Overlap"),
    ("scanchannel", "ScanChannel"),
    ("scanangle", "ScanAngle"),
    ("scananglerank", "ScanAngle"),
    ("userdata", "UserData"),
    ("pointsourceid", "PointSourceId"),
    ("gpstime", "GpsTime"),
    ("infrared", "Infrared"),
    ("nir", "Infrared"),
    ("confidence", names::CONFIDENCE),
    ("entropy", names::ENTROPY),
];

/// Names of coordinates, of colours in one array, and of what npz files hold about the whole cloud.
const TAKEN: [&str; 14] = [
    "x",
    "y",
    "z",
    "xyz",
    "points",
    "coordinates",
    "coords",
    "pos",
    "rgb",
    "color",
    "colors",
    "colours",
    "crs",
    "metres_per_unit",
];

/// PDAL's name of a column, or the name itself. Case and underscores are ignored.
pub fn name(given: &str) -> String {
    let plain: String = given.chars().filter(|c| *c != '_').flat_map(char::to_lowercase).collect();
    KNOWN.iter().find(|(name, _)| *name == plain).map_or_else(|| given.to_string(), |(_, known)| (*known).to_string())
}

/// Whether some format has something else than a dimension of its own under this name. Case is ignored.
pub(in crate::io) fn is_taken(name: &str) -> bool {
    TAKEN.contains(&name.to_lowercase().as_str())
}

#[cfg(test)]
mod tests {
    use super::{is_taken, name};

    #[test]
    fn usual_spellings_are_known_and_others_stay() {
        assert_eq!(name("returnnumber"), "ReturnNumber");
        assert_eq!(name("gps_time"), "GpsTime");
        assert_eq!(name("Label"), "Classification");
        assert_eq!(name("normal_x"), "normal_x");
        assert!(["x", "Y", "xyz"].into_iter().all(is_taken) && !is_taken("normal_x"));
    }
}
