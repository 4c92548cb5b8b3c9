//! Units of coordinate reference systems, read from their text.
//!
//! A system is given as WKT (OGC 01-009, ISO 19162) or as a code of the EPSG registry (`EPSG:2229`, and with a vertical
//! system `EPSG:2229+5703`).

use super::epsg::vertical_wkt;
pub use super::epsg::wkt_of;
use super::wkt::Node;
pub(crate) use super::wkt::part_of;
use serde::Serialize;
use std::f64::consts::PI;

/// Two units of length whose sizes differ by less, as a share, are the same; the kinds of feet differ by 1.3e-7 and more.
const SAME: f64 = 1e-7;

/// The same for angles, which some texts give with three digits.
const SAME_ANGLE: f64 = 0.01;

/// A datum in WKT 1, which needs an ellipsoid: that of WGS 84, as other programs have it.
const UNKNOWN_DATUM: &str = r#"DATUM["unknown",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0]"#;

/// The unit of horizontal coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// A length, in metres.
    Length(f64),
    /// An angle on the ellipsoid, in radians: mostly the degree.
    Angle(f64),
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearUnit {
    /// Its code in EPSG's registry.
    pub code: u16,
    /// Its name there.
    pub name: &'static str,
    /// Metres in one.
    pub metres: f64,
}

impl LinearUnit {
    const ALL: [Self; 13] = [
        Self { code: 9001, name: "metre", metres: 1.0 },
        Self { code: 9002, name: "foot", metres: 0.3048 },
        Self { code: 9003, name: "US survey foot", metres: 1200.0 / 3937.0 },
        Self { code: 9005, name: "Clarke's foot", metres: 0.304_797_265_4 },
        Self { code: 9030, name: "nautical mile", metres: 1852.0 },
        Self { code: 9031, name: "German legal metre", metres: 1.000_013_596_5 },
        Self { code: 9036, name: "kilometre", metres: 1000.0 },
        Self { code: 9040, name: "British yard (Sears 1922)", metres: 0.914_398_414_616_029 },
        Self { code: 9041, name: "British foot (Sears 1922)", metres: 0.304_799_471_538_676 },
        Self { code: 9080, name: "Indian foot", metres: 0.304_799_510_248_147 },
        Self { code: 9094, name: "Gold Coast foot", metres: 0.304_799_710_181_509 },
        Self { code: 9095, name: "British foot (1936)", metres: 0.304_800_749_1 },
        Self { code: 9096, name: "yard", metres: 0.9144 },
    ];

    /// The unit of that many metres.
    pub fn of(metres: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| same_length(metres, unit.metres))
    }

    /// The unit with that code.
    pub fn coded(code: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.code == code)
    }
}

/// A unit of angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngularUnit {
    /// Its code in EPSG's registry.
    pub code: u16,
    /// Its name there.
    pub name: &'static str,
    /// Radians in one.
    pub radians: f64,
}

impl AngularUnit {
    const ALL: [Self; 3] = [
        Self { code: 9102, name: "degree", radians: PI / 180.0 },
        Self { code: 9105, name: "grad", radians: PI / 200.0 },
        Self { code: 9101, name: "radian", radians: 1.0 },
    ];

    /// The unit of that many radians.
    pub fn of(radians: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| (radians / unit.radians - 1.0).abs() < SAME_ANGLE)
    }

    /// The unit with that code.
    pub fn coded(code: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.code == code)
    }
}

/// What angles in such a unit are called: `degrees`, `grads`.
pub fn angles(radians: f64) -> String {
    AngularUnit::of(radians).map_or("angles".into(), |unit| format!("{}s", unit.name))
}

/// Whether two units, in metres, are the same but for rounding.
pub fn same_length(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < SAME
}

/// The unit of x and y; `None` if the text does not say.
pub fn unit_of(crs: &str) -> Option<Unit> {
    match epsg_code(crs) {
        Some(code) => horizontal(&Node::parse(&wkt_of(code)?)?),
        None => horizontal(&Node::parse(crs)?),
    }
}

/// What to tell the user of geocentric coordinates.
pub const GEOCENTRIC: &str = "x, y and z are geocentric, so that z is no height: project the cloud first, e.g. with PDAL's \
                              filters.reprojection to UTM";

/// Whether x, y and z are counted from the centre of the earth, so that z is no height.
pub fn is_geocentric(crs: &str) -> bool {
    let node = epsg_code(crs).map_or_else(|| Node::parse(crs), |code| Node::parse(&wkt_of(code)?));
    node.is_some_and(|node| node.part(|system| system.is_geocentric().then_some(())).is_some())
}

/// Metres per unit of height, if the system has a vertical part that states it.
pub fn vertical_unit_of(crs: &str) -> Option<f64> {
    match (added_vertical(crs), epsg_code(crs)) {
        (Some(code), _) => vertical(&Node::parse(vertical_wkt(code)?)?),
        (None, Some(code)) => vertical(&Node::parse(&wkt_of(code)?)?),
        (None, None) => vertical(&Node::parse(crs)?),
    }
}

/// What to tell the user of coordinates whose unit is not the one that their system states; metres without a statement.
pub fn other_unit(metres: Option<f64>, crs: Option<&str>) -> Option<String> {
    let metres = metres?;
    let instead = match crs.and_then(unit_of) {
        Some(Unit::Length(stated)) if same_length(stated, metres) => return None,
        None if same_length(metres, 1.0) => return None,
        Some(Unit::Length(stated)) => format!("; the file tells a reference system in units of {stated} m"),
        Some(Unit::Angle(radians)) => format!("; the file tells a reference system in {}", angles(radians)),
        None => String::new(),
    };
    Some(format!("not kept: the unit of {metres} m{instead}"))
}

/// What is known of the heights of a system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Vertical {
    /// EPSG code of the vertical system.
    pub code: Option<u16>,
    /// Metres per unit of height.
    pub metres_per_unit: Option<f64>,
}

/// The vertical part of a system; `None` if the system says nothing of heights.
pub fn vertical_of(crs: &str) -> Option<Vertical> {
    let found = Vertical { code: codes_of(crs).vertical, metres_per_unit: vertical_unit_of(crs) };
    (found != Vertical::default()).then_some(found)
}

/// What to tell the user of a vertical system whose unit our table does not tell.
pub fn unknown_vertical(crs: &str) -> Option<String> {
    match vertical_of(crs)? {
        Vertical { code: Some(code), metres_per_unit: None } => Some(format!(
            "the vertical system EPSG:{code} is not in our table: its code is kept, and heights are taken in the unit of x and y"
        )),
        _ => None,
    }
}

/// What is wrong with a text such as `EPSG:7405+5703`: its second part is no code, or its first has heights of its own.
pub fn contradiction(crs: &str) -> Option<String> {
    let (code, (_, second)) = (epsg_code(crs)?, crs.split_once('+')?);
    let shown: String = crs.chars().take(60).collect();
    let plain = format!("EPSG:{code}");
    let Ok(second) = second.trim().parse::<u16>() else {
        return Some(format!("{shown}: expected the code of a vertical system after the +, as in {plain}+5703"));
    };
    let Codes { horizontal, vertical } = codes_of(&plain);
    match vertical {
        Some(own) if own != second => {
            let plane = horizontal.unwrap_or(code);
            Some(format!(
                "{shown}: {plain} has a vertical system of its own, EPSG:{own}: expected {plain} alone, or EPSG:{plane}+{second}"
            ))
        }
        None if has_own_heights(code) => {
            Some(format!("{shown}: {plain} has three axes, its own heights: expected {plain} alone"))
        }
        _ => None,
    }
}

/// Whether a code of the table is that of a system of three axes: geocentric, or geographic with ellipsoidal heights.
fn has_own_heights(code: u16) -> bool {
    wkt_of(code).and_then(|wkt| Node::parse(&wkt)).is_some_and(|node| {
        node.part(|system| (system.is_geocentric() || system.has_axes("3")).then_some(())).is_some()
    })
}

/// What is stated of x and y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plane {
    /// EPSG code of their system.
    pub code: Option<u16>,
    /// Their unit.
    pub unit: Option<Unit>,
}

impl Plane {
    /// Metres per unit, as stated or by the code.
    pub fn metres(self) -> Option<f64> {
        match self.unit.or_else(|| unit_of(&format!("EPSG:{}", self.code?))) {
            Some(Unit::Length(metres)) => Some(metres),
            _ => None,
        }
    }

    /// A system in WKT 1 of which only the unit, and perhaps the code, are known.
    fn wkt(self) -> Option<String> {
        let name = self.code.map_or("unknown".into(), |code| format!("EPSG:{code}"));
        let id = self.code.map(|code| format!(",{}", authority(code))).unwrap_or_default();
        Some(match self.unit? {
            Unit::Length(metres) => {
                let unit = length_unit(metres);
                format!("LOCAL_CS[\"{name}\",{unit},AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]{id}]")
            }
            Unit::Angle(radians) => {
                let unit = AngularUnit::of(radians).map_or("unit", |unit| unit.name);
                format!("GEOGCS[\"{name}\",{UNKNOWN_DATUM},UNIT[\"{unit}\",{radians}]{id}]")
            }
        })
    }
}

/// The system of x and y and what is stated of heights as one text: `EPSG:n`, `EPSG:n+m`, or WKT if the unit of heights is
/// not the one that the vertical system, or else x and y, have, or if no code tells that x and y are angles. `None` if
/// only the unit of x and y is known, a length.
///
/// A vertical code counts more than that of a compound system, of which only the horizontal part is left then. Systems of
/// three axes have their heights themselves.
pub fn with_heights(plane: Plane, heights: Vertical) -> Option<String> {
    let angles = matches!(plane.unit, Some(Unit::Angle(_)));
    match plane.code.filter(|&code| !angles || wkt_of(code).is_some()) {
        Some(code) => Some(over_code(code, plane, heights)),
        None => over_unit(plane, heights),
    }
}

/// Heights over a plane whose code tells enough.
fn over_code(code: u16, plane: Plane, heights: Vertical) -> String {
    let whole = format!("EPSG:{code}");
    if has_own_heights(code) {
        return whole;
    }
    let Codes { horizontal, vertical } = codes_of(&whole);
    let horizontal = horizontal.unwrap_or(code);
    let short = match heights.code.filter(|&stated| vertical != Some(stated)) {
        Some(stated) => format!("EPSG:{horizontal}+{stated}"),
        None => whole,
    };
    let usual = vertical_unit_of(&short).or(plane.metres()).unwrap_or(1.0);
    let own = heights.metres_per_unit.filter(|&own| !same_length(own, usual));
    // Without a unit, x and y are taken as metres everywhere.
    let unit = Some(Unit::Length(plane.metres().unwrap_or(1.0)));
    let base = || wkt_of(horizontal).or_else(|| Plane { unit, ..plane }.wkt());
    let text = own.and_then(|own| Some(compound(&short, &base()?, &heights_of(heights.code.or(vertical), own))));
    text.unwrap_or(short)
}

/// Heights over a plane of which no code tells enough.
fn over_unit(plane: Plane, heights: Vertical) -> Option<String> {
    let base = plane.wkt()?;
    let of_code = || vertical(&Node::parse(vertical_wkt(heights.code?)?)?);
    let own = heights.metres_per_unit.or_else(of_code);
    let other = |own: f64| !same_length(own, plane.metres().unwrap_or(1.0));
    match own.filter(|&own| heights.code.is_some() || other(own)) {
        Some(own) => Some(compound("unknown", &base, &heights_of(heights.code, own))),
        None => Some(base).filter(|_| plane.metres().is_none()),
    }
}

/// A vertical system in WKT 1 of which only the unit, and perhaps the code, are known.
fn heights_of(code: Option<u16>, metres: f64) -> String {
    let name = code.map_or("unknown".into(), |code| format!("EPSG:{code}"));
    let id = code.map(|code| format!(",{}", authority(code))).unwrap_or_default();
    format!("VERT_CS[\"{name}\",VERT_DATUM[\"unknown\",2005],{},AXIS[\"Up\",UP]{id}]", length_unit(metres))
}

/// A compound system in WKT 1.
fn compound(name: &str, plane: &str, heights: &str) -> String {
    format!("COMPD_CS[\"{name}\",{plane},{heights}]")
}

/// EPSG codes of the parts of a system, as far as they are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Codes {
    /// Of x and y: a projected, geographic or geocentric system.
    pub horizontal: Option<u16>,
    /// Of heights.
    pub vertical: Option<u16>,
}

/// The codes of a system's parts; those of a compound code are looked up.
pub fn codes_of(crs: &str) -> Codes {
    let code = epsg_code(crs);
    let node = code.map_or_else(|| Node::parse(crs), |code| Node::parse(&wkt_of(code)?));
    let (Some(node), added) = (node, added_vertical(crs)) else {
        return Codes { horizontal: code, vertical: added_vertical(crs) };
    };
    let own = code.filter(|_| !node.is_compound());
    let vertical = node.part(|part| part.code().filter(|_| part.is_vertical()));
    let horizontal = own.or_else(|| node.part(|part| part.code().filter(|_| !part.is_vertical())));
    Codes { horizontal, vertical: added.or(vertical) }
}

/// The second code of `EPSG:2229+5703`.
fn added_vertical(crs: &str) -> Option<u16> {
    epsg_code(crs).and_then(|_| crs.split_once('+')?.1.trim().parse().ok())
}

/// Whether two texts denote the same system: equal texts, or the same EPSG code of the whole or of the horizontal part.
/// Where both tell the system or the unit of heights, these must be the same too.
pub fn same(a: &str, b: &str) -> bool {
    let whole = |crs| epsg_code(crs).or_else(|| Node::parse(crs)?.code());
    let plane = |crs| codes_of(crs).horizontal;
    let equal = |one: Option<u16>, other: Option<u16>| one.is_some() && one == other;
    a == b || ((equal(whole(a), whole(b)) || equal(plane(a), plane(b))) && heights_agree(a, b))
}

/// The first of two systems that are the same, or the other if only that tells of heights.
pub fn more_told(first: String, other: &str) -> String {
    if vertical_of(&first).is_none() && vertical_of(other).is_some() { other.to_string() } else { first }
}

/// Whether two systems do not contradict each other about heights.
fn heights_agree(a: &str, b: &str) -> bool {
    let (Some(one), Some(other)) = (vertical_of(a), vertical_of(b)) else { return true };
    let codes = one.code.zip(other.code).is_none_or(|(a, b)| a == b);
    codes && one.metres_per_unit.zip(other.metres_per_unit).is_none_or(|(a, b)| same_length(a, b))
}

/// The code of `EPSG:2229`, of `EPSG:2229+5703` (its first part) and of `urn:ogc:def:crs:EPSG::2229`.
pub fn epsg_code(crs: &str) -> Option<u16> {
    let text = crs.trim();
    let head = text.get(..5).filter(|head| head.eq_ignore_ascii_case("EPSG:"));
    let urn = text.get(..21).filter(|head| head.eq_ignore_ascii_case("urn:ogc:def:crs:EPSG:"));
    let rest = match (head, urn) {
        (Some(_), _) => &text[5..],
        (_, Some(_)) => text[21..].rsplit(':').next()?,
        _ => return None,
    };
    rest.split('+').next()?.trim().parse().ok()
}

/// The WKT of a system that is given as WKT or as a code; `None` if the code is not in the table. A vertical code that is
/// not in the table is left out.
pub fn wkt(crs: &str) -> Option<String> {
    let Some(code) = epsg_code(crs) else { return Some(crs.to_string()) };
    let plane = wkt_of(code)?;
    let flat = ["PROJCS[", "GEOGCS["].iter().any(|kind| plane.starts_with(kind));
    let heights = added_vertical(crs).and_then(vertical_wkt).filter(|_| flat);
    Some(heights.map_or_else(|| plane.clone(), |heights| compound(crs.trim(), &plane, heights)))
}

/// Whether a text tells more than units, as [`local`] does.
pub fn is_place(crs: &str) -> bool {
    !crs.contains("LOCAL_CS[\"unknown\"")
}

/// A local system in WKT 1 that tells only the metres per unit of x and y.
pub fn local(metres: f64) -> String {
    Plane { code: None, unit: Some(Unit::Length(metres)) }.wkt().unwrap_or_default()
}

/// A unit of length in WKT 1.
fn length_unit(metres: f64) -> String {
    let name = LinearUnit::of(metres).map_or("unit", |unit| unit.name);
    format!("UNIT[\"{name}\",{metres}]")
}

/// A code of EPSG's registry in WKT 1.
fn authority(code: u16) -> String {
    format!("AUTHORITY[\"EPSG\",\"{code}\"]")
}

/// The unit of x and y.
fn horizontal(system: &Node) -> Option<Unit> {
    system.part(|system| match &system.keyword[..] {
        "PROJCS" | "PROJCRS" | "PROJECTEDCRS" | "LOCAL_CS" | "ENGCRS" => stated_length(system).map(Unit::Length),
        _ if system.is_geocentric() => stated_length(system).map(Unit::Length),
        "GEOGCS" | "GEOGCRS" | "GEOGRAPHICCRS" | "GEODCRS" | "GEODETICCRS" => {
            let radians = system.angle().or_else(|| known(system)?.angle());
            Some(Unit::Angle(radians.unwrap_or(PI / 180.0)))
        }
        _ => None,
    })
}

/// Metres per unit of height.
fn vertical(system: &Node) -> Option<f64> {
    system.part(|system| if system.is_vertical() { stated_length(system) } else { None })
}

/// Metres per unit, by the text or else by its code.
fn stated_length(system: &Node) -> Option<f64> {
    system.length().or_else(|| known(system)?.length())
}

/// The system in the table with the same code.
fn known(system: &Node) -> Option<Node> {
    Node::parse(&wkt_of(system.code()?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The name of a system's unit of angles.
    fn angular(crs: &str) -> &'static str {
        let Some(Unit::Angle(radians)) = unit_of(crs) else { panic!("{crs}") };
        AngularUnit::of(radians).unwrap().name
    }

    #[test]
    fn a_local_system_tells_its_unit() {
        for metres in [0.3048, 1200.0 / 3937.0, 1000.0] {
            assert_eq!(unit_of(&local(metres)), Some(Unit::Length(metres)));
        }
        assert!(local(0.3048).contains(r#""foot""#) && local(1200.0 / 3937.0).contains("US survey foot"));
    }

    #[test]
    fn codes_of_epsg_have_the_units_of_the_registry() {
        let foot = 1200.0 / 3937.0;
        for (code, metres) in [
            (2229, foot),
            (6539, foot),
            (2222, 0.3048),
            (32632, 1.0),
            (32733, 1.0),
            (25832, 1.0),
            (2154, 1.0),
            (28992, 1.0),
            (7415, 1.0),
            (2056, 1.0),
            (3857, 1.0),
            (4978, 1.0),
        ] {
            let Some(Unit::Length(found)) = unit_of(&format!("EPSG:{code}")) else { panic!("{code}") };
            assert!((found - metres).abs() < 1e-12, "{code}: {found}");
        }
        for code in ["EPSG:4326", "epsg:4979", "EPSG:4258", "urn:ogc:def:crs:EPSG::4326", "EPSG:4326+5773"] {
            assert_eq!(angular(code), "degree", "{code}");
        }
        // Around the meridian of Paris.
        for code in [4807, 4810, 4811, 4816, 4819, 4821, 4901, 4902] {
            assert_eq!(angular(&format!("EPSG:{code}")), "grad", "{code}");
        }
        for unknown in ["EPSG:1", "EPSG:65535", "EPSG:", "EPSG:x", "", "é:1234", "somewhere"] {
            assert_eq!(unit_of(unknown), None, "{unknown}");
        }
        assert_eq!(vertical_unit_of("EPSG:7415"), Some(1.0));
    }

    #[test]
    fn every_system_of_the_table_is_found_by_its_code() {
        let found: Vec<u16> = (0..=u16::MAX).step_by(7).filter(|&code| wkt_of(code).is_some()).collect();
        assert!(found.len() > 800, "{}", found.len());
        for code in found {
            let node = Node::parse(&wkt_of(code).unwrap()).unwrap();
            // A few withdrawn codes are represented by those that replaced them.
            assert!(node.code().is_none_or(|own| own == code || wkt_of(own).is_some()), "{code}");
        }
    }

    #[test]
    fn units_of_wkt_are_those_of_the_outermost_horizontal_system() {
        let compound = r#"COMPD_CS["x, [y]",PROJCS["y",GEOGCS["z",UNIT["degree",0.0174],AUTHORITY["EPSG","4269"]],UNIT["US survey foot",0.3048006]],VERT_CS["v",UNIT["metre",1]]]"#;
        assert_eq!((unit_of(compound), vertical_unit_of(compound)), (Some(Unit::Length(0.3048006)), Some(1.0)));
        let two = r#"PROJCRS["y",BASEGEOGCRS["z",DATUM["d",ELLIPSOID["e",6378137,298.2,LENGTHUNIT["metre",1]]],ID["EPSG",4269]],CONVERSION["c",PARAMETER["False easting",0,LENGTHUNIT["metre",1]]],CS[Cartesian,2],AXIS["e",east,ORDER[1],LENGTHUNIT["foot",0.3048]],AXIS["n",north,LENGTHUNIT["foot",0.3048]],ID["EPSG",2222]]"#;
        assert_eq!(unit_of(two), Some(Unit::Length(0.3048)));
        // Only a code of its own, at the right place; the code of the geographic part does not count.
        let bare = r#"PROJCS["y",GEOGCS["z",AUTHORITY["EPSG","4269"]],AUTHORITY["EPSG","2229"]]"#;
        assert_eq!(unit_of(bare), Some(Unit::Length(1200.0 / 3937.0)));
        assert_eq!(unit_of(r#"PROJCS["y",GEOGCS["z",AUTHORITY["EPSG","4269"]]]"#), None);
        assert_eq!(angular(r#"GEOGCS["z",UNIT["degree",0.0174]]"#), "degree");
        let grads = r#"GEOGCRS["z",CS[ellipsoidal,2],AXIS["lat",north,ANGLEUNIT["grad",0.0157079632679489]]]"#;
        assert_eq!((angular(grads), angular(r#"GEOGCS["z",AUTHORITY["EPSG","4807"]]"#)), ("grad", "grad"));
        assert_eq!(unit_of(r#"GEOGCS["z",UNIT["degree",0.0174"#), None);
        assert!(Node::parse(&"A[".repeat(1000)).is_none());
    }

    #[test]
    fn the_parts_of_a_system_have_codes_of_their_own() {
        let codes = |crs: &str| codes_of(crs);
        let of = |horizontal, vertical| Codes { horizontal, vertical };
        assert_eq!(codes("EPSG:2154"), of(Some(2154), None));
        assert_eq!(codes(&wkt_of(2154).unwrap()), of(Some(2154), None));
        assert_eq!(codes("EPSG:7415"), of(Some(28992), Some(5709)));
        assert_eq!(codes("EPSG:2229+5703"), of(Some(2229), Some(5703)));
        assert_eq!(codes("EPSG:65535"), of(Some(65535), None));
        assert_eq!((codes("somewhere"), codes("")), (Codes::default(), Codes::default()));
        let two = r#"COMPD_CS["c",PROJCS["y",GEOGCS["z",AUTHORITY["EPSG","4269"]],AUTHORITY["EPSG","26910"]],VERT_CS["v",AUTHORITY["EPSG","5703"]],AUTHORITY["EPSG","1"]]"#;
        assert_eq!(codes(two), of(Some(26910), Some(5703)));
    }

    #[test]
    fn heights_have_a_system_and_a_unit_of_their_own() {
        let foot = 1200.0 / 3937.0;
        // NAVD88 in metres, in US survey feet and in feet; NGVD29 in US survey feet.
        for (code, metres) in [(5703, 1.0), (6360, foot), (8228, 0.3048), (5702, foot)] {
            let crs = format!("EPSG:26910+{code}");
            let Vertical { code: found, metres_per_unit } = vertical_of(&crs).unwrap();
            assert_eq!(found, Some(code));
            assert!((metres_per_unit.unwrap() - metres).abs() < 1e-12, "{code}");
            assert_eq!((unit_of(&crs), unknown_vertical(&crs)), (Some(Unit::Length(1.0)), None));
            let text = wkt(&crs).unwrap();
            assert_eq!((codes_of(&text), vertical_of(&text)), (codes_of(&crs), vertical_of(&crs)));
        }
        let unknown = "EPSG:26910+5103";
        assert_eq!(vertical_of(unknown), Some(Vertical { code: Some(5103), metres_per_unit: None }));
        assert!(unknown_vertical(unknown).unwrap().contains("5103"));
        assert_eq!(wkt(unknown), wkt_of(26910));
        assert_eq!(vertical_of("EPSG:26910"), None);
    }

    fn over(code: u16, heights: Vertical) -> String {
        with_heights(Plane { code: Some(code), unit: None }, heights).unwrap()
    }

    #[test]
    fn a_unit_of_heights_that_no_code_tells_is_written_as_wkt() {
        let plane = || "EPSG:26910".to_string();
        let with = |code, metres_per_unit| over(26910, Vertical { code, metres_per_unit });
        assert_eq!((with(None, None), with(None, Some(1.0))), (plane(), plane()));
        assert_eq!((with(Some(6360), None), with(Some(6360), Some(1200.0 / 3937.0))), {
            let both = "EPSG:26910+6360".to_string();
            (both.clone(), both)
        });
        assert_eq!(with(Some(5103), Some(1.0)), "EPSG:26910+5103");
        for (code, metres) in [(None, 0.3048), (Some(5703), 0.3048), (Some(5103), 0.3048)] {
            let found = with(code, Some(metres));
            assert_eq!(vertical_of(&found), Some(Vertical { code, metres_per_unit: Some(metres) }));
            assert_eq!((unit_of(&found), codes_of(&found).horizontal), (Some(Unit::Length(1.0)), Some(26910)));
        }
        let feet = Vertical { code: None, metres_per_unit: Some(0.3048) };
        let over_unit = |metres, heights| with_heights(Plane { code: None, unit: Some(Unit::Length(metres)) }, heights);
        let local = over_unit(1.0, feet).unwrap();
        assert!(!is_place(&local) && unit_of(&local) == Some(Unit::Length(1.0)) && vertical_of(&local) == Some(feet));
        assert_eq!((with_heights(Plane::default(), feet), over_unit(0.3048, feet)), (None, None));
        // A plane in feet without a code, heights in metres with one.
        for metres_per_unit in [None, Some(1.0)] {
            let local = over_unit(0.3048, Vertical { code: Some(5703), metres_per_unit }).unwrap();
            assert_eq!(vertical_of(&local), Some(Vertical { code: Some(5703), metres_per_unit: Some(1.0) }));
            assert_eq!(unit_of(&local), Some(Unit::Length(0.3048)));
        }
    }

    #[test]
    fn a_plane_whose_code_is_not_in_the_table_keeps_the_unit_of_heights() {
        assert_eq!(wkt_of(64000), None);
        let feet = |code| Vertical { code, metres_per_unit: Some(0.3048) };
        for (unit, metres) in [(None, 1.0), (Some(Unit::Length(1000.0)), 1000.0)] {
            for code in [None, Some(5703), Some(5103)] {
                let found = with_heights(Plane { code: Some(64000), unit }, feet(code)).unwrap();
                assert_eq!((unit_of(&found), vertical_of(&found)), (Some(Unit::Length(metres)), Some(feet(code))));
                assert_eq!(codes_of(&found), Codes { horizontal: Some(64000), vertical: code });
                assert!(is_place(&found) && same(&found, "EPSG:64000"), "{found}");
            }
        }
        assert_eq!(over(64000, Vertical { code: Some(5703), metres_per_unit: Some(1.0) }), "EPSG:64000+5703");
        assert_eq!(over(64000, Vertical::default()), "EPSG:64000");
    }

    #[test]
    fn angles_without_a_known_code_stay_angles() {
        let grad = Some(Unit::Angle(PI / 200.0));
        for code in [None, Some(64000)] {
            for heights in [Vertical::default(), Vertical { code: None, metres_per_unit: Some(0.3048) }] {
                let found = with_heights(Plane { code, unit: grad }, heights).unwrap();
                assert_eq!((angular(&found), codes_of(&found).horizontal), ("grad", code));
                assert_eq!(vertical_of(&found).unwrap_or_default(), heights);
            }
        }
        assert_eq!(with_heights(Plane { code: Some(4807), unit: grad }, Vertical::default()).unwrap(), "EPSG:4807");
    }

    #[test]
    fn a_vertical_code_counts_more_than_that_of_a_compound_system() {
        let coded = |code| Vertical { code: Some(code), metres_per_unit: None };
        assert_eq!(
            (over(7405, coded(5701)), over(7405, Vertical::default())),
            ("EPSG:7405".into(), "EPSG:7405".into())
        );
        assert_eq!(
            (over(7405, coded(5703)), over(5498, coded(5702))),
            ("EPSG:27700+5703".into(), "EPSG:4269+5702".into())
        );
        // The unit of a compound system's heights may be another one.
        let feet = over(7405, Vertical { code: None, metres_per_unit: Some(0.3048) });
        assert_eq!(vertical_of(&feet), Some(Vertical { code: Some(5701), metres_per_unit: Some(0.3048) }));
        assert_eq!((codes_of(&feet).horizontal, unit_of(&feet)), (Some(27700), Some(Unit::Length(1.0))));
        for three_axes in [4979, 4978] {
            assert_eq!(over(three_axes, coded(5703)), format!("EPSG:{three_axes}"));
        }
    }

    #[test]
    fn second_heights_are_a_contradiction() {
        for fine in
            ["EPSG:7405", "EPSG:7405+5701", "EPSG:26910+5703", "EPSG:64000+5703", "EPSG:26910+5103", "somewhere+x", ""]
        {
            assert_eq!(contradiction(fine), None, "{fine}");
        }
        for (wrong, advice) in [
            ("EPSG:7405+5703", "EPSG:27700+5703"),
            ("epsg:5498 + 5702", "EPSG:4269+5702"),
            ("urn:ogc:def:crs:EPSG::7405+5703", "EPSG:7405 alone"),
            ("EPSG:4979+5703", "three axes"),
            ("EPSG:4978+5703", "three axes"),
            ("EPSG:26910+", "after the +"),
            ("EPSG:26910+navd88", "EPSG:26910+5703"),
            ("EPSG:26910+5703+5702", "after the +"),
        ] {
            let found = contradiction(wrong).unwrap();
            assert!(found.starts_with(wrong) && found.contains(advice), "{found}");
        }
    }

    #[test]
    fn geocentric_systems_are_recognised_in_wkt_1_and_2() {
        let two = |keyword: &str, end: &str| {
            format!(
                r#"{keyword}["c",DATUM["d",ELLIPSOID["e",6378137,298.2,LENGTHUNIT["metre",1]]],CS[Cartesian,3],AXIS["(X)",geocentricX],AXIS["(Y)",geocentricY],AXIS["(Z)",geocentricZ]{end}]"#
            )
        };
        let foot = r#",LENGTHUNIT["foot",0.3048]"#;
        for keyword in ["GEODCRS", "GEODETICCRS"] {
            let bound = format!("BOUNDCRS[SOURCECRS[{}],TARGETCRS[{}]]", two(keyword, foot), two(keyword, ""));
            for crs in [two(keyword, foot), bound] {
                assert!(is_geocentric(&crs) && unit_of(&crs) == Some(Unit::Length(0.3048)), "{crs}");
                assert_eq!((vertical_unit_of(&crs), vertical_of(&crs)), (None, None));
            }
            // Without a unit, that of the code.
            let coded = two(keyword, r#",ID["EPSG",4978]"#);
            assert_eq!((unit_of(&coded), codes_of(&coded).horizontal), (Some(Unit::Length(1.0)), Some(4978)));
            assert!(same(&coded, "EPSG:4978") && unit_of(&two(keyword, "")).is_none());
            let flat =
                format!(r#"{keyword}["g",CS[ellipsoidal,2],AXIS["lat",north],ANGLEUNIT["degree",0.0174532925199433]]"#);
            assert!(!is_geocentric(&flat) && angular(&flat) == "degree");
        }
        assert!(is_geocentric("EPSG:4978") && is_geocentric(&wkt_of(4936).unwrap()));
        assert!(!["EPSG:4979", "EPSG:4326", "EPSG:7405", "EPSG:25832", "somewhere"].into_iter().any(is_geocentric));
    }

    #[test]
    fn units_have_codes_and_sizes_that_tell_them_apart() {
        for unit in LinearUnit::ALL {
            assert_eq!((LinearUnit::of(unit.metres), LinearUnit::coded(unit.code)), (Some(unit), Some(unit)));
        }
        for unit in AngularUnit::ALL {
            assert_eq!(AngularUnit::of(unit.radians), Some(unit));
        }
        assert_eq!((LinearUnit::of(0.7), LinearUnit::coded(9102), AngularUnit::of(0.7)), (None, None, None));
        assert_eq!(
            (angles(PI / 180.0), angles(PI / 200.0), angles(0.7)),
            ("degrees".into(), "grads".into(), "angles".into())
        );
    }

    #[test]
    fn systems_that_differ_in_heights_are_others() {
        assert!(same("EPSG:26910", "EPSG:26910+5703") && same("EPSG:26910+5103", "EPSG:26910+5103"));
        assert!(!same("EPSG:26910+5703", "EPSG:26910+6360") && !same("EPSG:26910", "EPSG:26911+5703"));
        assert!(same("EPSG:7415", "EPSG:28992+5709"));
    }

    #[test]
    fn one_system_may_be_written_in_two_ways() {
        assert!(same("EPSG:25832", &wkt_of(25832).unwrap()));
        assert!(!same("EPSG:25833", &wkt_of(25832).unwrap()) && !same("EPSG:25833", "PROJCS[\"a\"]"));
    }
}
