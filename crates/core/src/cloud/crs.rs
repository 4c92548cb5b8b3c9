//! Units of coordinate reference systems, read from their text.
//!
//! A system is given as WKT (OGC 01-009, ISO 19162) or as a code of the EPSG registry (`EPSG:2229`, and with a vertical
//! system `EPSG:2229+5703`). `epsg.bin` contains the WKT of EPSG's codes; `scripts/epsg-table` generates it.

use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Read;
use std::sync::OnceLock;

/// EPSG's systems as WKT, deflated; `scripts/epsg-table` describes the layout.
const EPSG: &[u8] = include_bytes!("epsg.bin");

/// Bytes per entry of the table's index.
const ENTRY: usize = 6;

/// Largest nesting of brackets that is accepted.
const DEEPEST: usize = 32;

/// Two units whose sizes differ by less, as a share, are the same; the two kinds of feet differ by 2e-6.
const SAME: f64 = 1e-7;

/// The unit of horizontal coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// A length, in metres.
    Length(f64),
    /// Angles on the ellipsoid.
    Degrees,
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
    const COMMON: [Self; 3] = [
        Self { code: 9001, name: "metre", metres: 1.0 },
        Self { code: 9002, name: "foot", metres: 0.3048 },
        Self { code: 9003, name: "US survey foot", metres: 1200.0 / 3937.0 },
    ];

    /// The common unit of that many metres.
    pub fn of(metres: f64) -> Option<Self> {
        Self::COMMON.into_iter().find(|unit| same_length(metres, unit.metres))
    }
}

/// Whether two units, in metres, are the same but for rounding.
pub fn same_length(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < SAME
}

/// The unit of x and y; `None` if the text does not say.
pub fn unit_of(crs: &str) -> Option<Unit> {
    match epsg_code(crs) {
        Some(code) => Node::parse(&wkt_of(code)?)?.horizontal(),
        None => Node::parse(crs)?.horizontal(),
    }
}

/// Metres per unit of height, if the system has a vertical part that states it.
pub fn vertical_unit_of(crs: &str) -> Option<f64> {
    match (added_vertical(crs), epsg_code(crs)) {
        (Some(code), _) => Node::parse(vertical_wkt(code)?)?.vertical(),
        (None, Some(code)) => Node::parse(&wkt_of(code)?)?.vertical(),
        (None, None) => Node::parse(crs)?.vertical(),
    }
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

/// The horizontal system (`EPSG:n`) and what is stated of heights as one text: `EPSG:n+m`, or WKT if the unit of heights
/// is not the one that the vertical system, or else x and y, have. `metres` are those per unit of x and y.
pub fn with_heights(plane: Option<String>, metres: Option<f64>, heights: Vertical) -> Option<String> {
    let of_code = heights.code.and_then(|code| Node::parse(vertical_wkt(code)?)?.vertical());
    let own = match plane {
        Some(_) => heights.metres_per_unit.filter(|&own| !same_length(own, of_code.or(metres).unwrap_or(1.0))),
        // No code stands for the whole then.
        None => heights
            .metres_per_unit
            .or(of_code)
            .filter(|&own| heights.code.is_some() || metres.is_some_and(|metres| !same_length(own, metres))),
    };
    let short = plane.as_ref().map(|plane| match heights.code {
        Some(code) => format!("{plane}+{code}"),
        None => plane.clone(),
    });
    let base = match plane.as_deref().and_then(epsg_code) {
        Some(code) => wkt_of(code).filter(|wkt| !wkt.starts_with("COMPD_CS[")),
        None => metres.map(local),
    };
    match (own, base) {
        (Some(own), Some(base)) => {
            let name = short.as_deref().unwrap_or("unknown");
            Some(compound(name, &base, &heights_of(heights.code, own)))
        }
        _ => short,
    }
}

/// A vertical system in WKT 1 of which only the unit, and perhaps the code, are known.
fn heights_of(code: Option<u16>, metres: f64) -> String {
    let unit = LinearUnit::of(metres).map_or("unit", |unit| unit.name);
    let name = code.map_or("unknown".into(), |code| format!("EPSG:{code}"));
    let id = code.map(|code| format!(",AUTHORITY[\"EPSG\",\"{code}\"]")).unwrap_or_default();
    format!("VERT_CS[\"{name}\",VERT_DATUM[\"unknown\",2005],UNIT[\"{unit}\",{metres}],AXIS[\"Up\",UP]{id}]")
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
    let heights = added_vertical(crs).and_then(vertical_wkt).filter(|_| !plane.starts_with("COMPD_CS["));
    Some(heights.map_or_else(|| plane.clone(), |heights| compound(crs.trim(), &plane, heights)))
}

/// The WKT of an EPSG code, if it is in the table.
pub fn wkt_of(code: u16) -> Option<String> {
    let first = |frame: usize| number(2 + ENTRY * frame, 2);
    let frame = (0..frames()).take_while(|&f| first(f).is_some_and(|c| c <= usize::from(code))).last()?;
    let text = lines_of(frame)?;
    let line = text.lines().find_map(|line| line.split_once('\t').filter(|(c, _)| c.parse() == Ok(code)))?;
    Some(line.1.to_string())
}

/// A number of the table.
fn number(at: usize, bytes: usize) -> Option<usize> {
    Some(EPSG.get(at..at + bytes)?.iter().rev().fold(0, |sum, &byte| sum << 8 | usize::from(byte)))
}

/// Number of frames of the table.
fn frames() -> usize {
    number(0, 2).unwrap_or(0)
}

/// The systems in a frame of the table, one a line.
fn lines_of(frame: usize) -> Option<String> {
    let end = |frame: usize| number(4 + ENTRY * frame, 4);
    let start = if frame == 0 { 0 } else { end(frame - 1)? };
    let data = 2 + ENTRY * frames();
    let mut text = String::new();
    flate2::read::DeflateDecoder::new(EPSG.get(data + start..data + end(frame)?)?).read_to_string(&mut text).ok()?;
    Some(text)
}

/// The WKT of a vertical system; the table has those that are a part of its compound systems.
fn vertical_wkt(code: u16) -> Option<&'static str> {
    static KNOWN: OnceLock<BTreeMap<u16, String>> = OnceLock::new();
    KNOWN.get_or_init(vertical_parts).get(&code).map(String::as_str)
}

/// The vertical parts of the table's compound systems, by code.
fn vertical_parts() -> BTreeMap<u16, String> {
    let mut found = BTreeMap::new();
    for text in (0..frames()).filter_map(lines_of) {
        for part in
            text.lines().filter(|line| line.contains("\tCOMPD_CS[")).filter_map(|line| part_of(line, "VERT_CS["))
        {
            if let Some(code) = Node::parse(part).and_then(|node| node.code()) {
                found.entry(code).or_insert_with(|| part.to_string());
            }
        }
    }
    found
}

/// The first part of a WKT text that begins so, as in `PROJCS[`, up to its closing bracket.
pub(crate) fn part_of<'a>(wkt: &'a str, opening: &str) -> Option<&'a str> {
    let text = wkt.get(wkt.find(opening)?..)?;
    let (mut open, mut quoted) = (0usize, false);
    let end = text.char_indices().find(|&(_, c)| {
        match c {
            '"' => quoted = !quoted,
            '[' if !quoted => open += 1,
            ']' if !quoted => open = open.saturating_sub(1),
            _ => return false,
        }
        c == ']' && open == 0
    })?;
    text.get(..=end.0)
}

/// Whether a text tells more than units, as [`local`] does.
pub fn is_place(crs: &str) -> bool {
    !crs.contains("LOCAL_CS[\"unknown\"")
}

/// A local system in WKT 1 that tells only the metres per unit of x and y.
pub fn local(metres: f64) -> String {
    let name = LinearUnit::of(metres).map_or("unit", |unit| unit.name);
    format!("LOCAL_CS[\"unknown\",UNIT[\"{name}\",{metres}],AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]]")
}

/// `KEYWORD[value, value, ..., NODE[...], ...]`.
#[derive(Debug, Default)]
struct Node {
    keyword: String,
    values: Vec<String>,
    children: Vec<Node>,
}

impl Node {
    /// Parses a text; `None` if its brackets do not match.
    fn parse(text: &str) -> Option<Self> {
        let mut open: Vec<Self> = Vec::new();
        let (mut word, mut quoted) = (String::new(), false);
        for c in text.chars() {
            match c {
                '"' => quoted = !quoted,
                _ if quoted => word.push(c),
                '[' | '(' => {
                    let keyword = std::mem::take(&mut word).trim().to_ascii_uppercase();
                    open.push(Self { keyword, ..Self::default() });
                    if open.len() > DEEPEST {
                        return None;
                    }
                }
                ',' | ']' | ')' => {
                    let value = std::mem::take(&mut word).trim().to_string();
                    let node = open.last_mut()?;
                    if !value.is_empty() {
                        node.values.push(value);
                    }
                    if c == ',' {
                        continue;
                    }
                    let closed = open.pop()?;
                    match open.last_mut() {
                        Some(parent) => parent.children.push(closed),
                        None => return Some(closed),
                    }
                }
                _ => word.push(c),
            }
        }
        None
    }

    fn child(&self, keywords: &[&str]) -> Option<&Self> {
        self.children.iter().find(|child| keywords.contains(&&child.keyword[..]))
    }

    /// The base of a bound system, and of a compound one the first part with that property.
    fn part<T>(&self, of: impl Fn(&Self) -> Option<T> + Copy) -> Option<T> {
        match &self.keyword[..] {
            _ if self.is_compound() => self.children.iter().find_map(|part| part.part(of)),
            "BOUNDCRS" => self.child(&["SOURCECRS"])?.children.first()?.part(of),
            _ => of(self),
        }
    }

    /// The unit of x and y.
    fn horizontal(&self) -> Option<Unit> {
        self.part(|system| match &system.keyword[..] {
            "PROJCS" | "PROJCRS" | "PROJECTEDCRS" | "LOCAL_CS" | "ENGCRS" | "GEOCCS" => {
                system.length().or_else(|| system.known().and_then(|known| known.length())).map(Unit::Length)
            }
            // WKT 2 treats geocentric systems as geodetic ones with Cartesian axes.
            "GEODCRS" | "GEODETICCRS" if system.is_cartesian() => system.length().map(Unit::Length),
            "GEOGCS" | "GEOGCRS" | "GEOGRAPHICCRS" | "GEODCRS" | "GEODETICCRS" => Some(Unit::Degrees),
            _ => None,
        })
    }

    /// Metres per unit of height.
    fn vertical(&self) -> Option<f64> {
        self.part(|system| match system.is_vertical() {
            true => system.length().or_else(|| system.known().and_then(|known| known.length())),
            false => None,
        })
    }

    fn is_vertical(&self) -> bool {
        ["VERT_CS", "VERTCRS", "VERTICALCRS"].contains(&&self.keyword[..])
    }

    fn is_compound(&self) -> bool {
        ["COMPD_CS", "COMPOUNDCRS"].contains(&&self.keyword[..])
    }

    fn is_cartesian(&self) -> bool {
        self.child(&["CS"]).is_some_and(|cs| cs.values.iter().any(|v| v.eq_ignore_ascii_case("Cartesian")))
    }

    /// Metres per unit of the system itself: of its first axis (WKT 2), or of all its axes.
    fn length(&self) -> Option<f64> {
        let units = ["UNIT", "LENGTHUNIT"];
        let of_axis = || self.child(&["AXIS"])?.child(&units);
        let factor: f64 = self.child(&units).or_else(of_axis)?.values.get(1)?.parse().ok()?;
        (factor.is_finite() && factor > 0.0).then_some(factor)
    }

    /// The EPSG code of this node itself, not of a node inside it.
    fn code(&self) -> Option<u16> {
        let id = self.child(&["AUTHORITY", "ID"])?;
        match &id.values[..] {
            [authority, code, ..] if authority.eq_ignore_ascii_case("EPSG") => code.parse().ok(),
            _ => None,
        }
    }

    /// The system in the table with this one's code.
    fn known(&self) -> Option<Self> {
        Self::parse(&wkt_of(self.code()?)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert_eq!(unit_of(code), Some(Unit::Degrees), "{code}");
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
        assert_eq!(unit_of(r#"GEOGCS["z",UNIT["degree",0.0174]]"#), Some(Unit::Degrees));
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

    #[test]
    fn a_unit_of_heights_that_no_code_tells_is_written_as_wkt() {
        let plane = || Some("EPSG:26910".to_string());
        let with =
            |code, metres_per_unit| with_heights(plane(), Some(1.0), Vertical { code, metres_per_unit }).unwrap();
        assert_eq!((with(None, None), with(None, Some(1.0))), (plane().unwrap(), plane().unwrap()));
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
        let local = with_heights(None, Some(1.0), feet).unwrap();
        assert!(!is_place(&local) && unit_of(&local) == Some(Unit::Length(1.0)) && vertical_of(&local) == Some(feet));
        assert_eq!(with_heights(None, None, feet), None);
        // A plane in feet without a code, heights in metres with one.
        for metres_per_unit in [None, Some(1.0)] {
            let heights = Vertical { code: Some(5703), metres_per_unit };
            let local = with_heights(None, Some(0.3048), heights).unwrap();
            assert_eq!(vertical_of(&local), Some(Vertical { code: Some(5703), metres_per_unit: Some(1.0) }));
            assert_eq!(unit_of(&local), Some(Unit::Length(0.3048)));
        }
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
