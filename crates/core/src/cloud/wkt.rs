//! The text form of reference systems, WKT 1 (OGC 01-009) and WKT 2 (ISO 19162), as a tree.

/// Largest nesting of brackets that is accepted.
const DEEPEST: usize = 32;

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

/// `KEYWORD[value, value, ..., NODE[...], ...]`.
#[derive(Debug, Default)]
pub(super) struct Node {
    pub(super) keyword: String,
    values: Vec<String>,
    children: Vec<Node>,
}

impl Node {
    /// Parses a text; `None` if its brackets do not match.
    pub(super) fn parse(text: &str) -> Option<Self> {
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
    pub(super) fn part<T>(&self, of: impl Fn(&Self) -> Option<T> + Copy) -> Option<T> {
        match &self.keyword[..] {
            _ if self.is_compound() => self.children.iter().find_map(|part| part.part(of)),
            "BOUNDCRS" => self.child(&["SOURCECRS"])?.children.first()?.part(of),
            _ => of(self),
        }
    }

    pub(super) fn is_vertical(&self) -> bool {
        ["VERT_CS", "VERTCRS", "VERTICALCRS"].contains(&&self.keyword[..])
    }

    pub(super) fn is_compound(&self) -> bool {
        ["COMPD_CS", "COMPOUNDCRS"].contains(&&self.keyword[..])
    }

    /// WKT 2 treats geocentric systems as geodetic ones with Cartesian axes.
    pub(super) fn is_geocentric(&self) -> bool {
        let geodetic = ["GEODCRS", "GEODETICCRS"].contains(&&self.keyword[..]);
        self.keyword == "GEOCCS" || geodetic && self.has_axes("Cartesian")
    }

    /// Whether the axes (WKT 2) are of that kind, or that many.
    pub(super) fn has_axes(&self, kind: &str) -> bool {
        self.child(&["CS"]).is_some_and(|cs| cs.values.iter().any(|v| v.eq_ignore_ascii_case(kind)))
    }

    /// Metres per unit of the system itself.
    pub(super) fn length(&self) -> Option<f64> {
        self.factor(&["UNIT", "LENGTHUNIT"])
    }

    /// Radians per unit of the system itself.
    pub(super) fn angle(&self) -> Option<f64> {
        self.factor(&["UNIT", "ANGLEUNIT"])
    }

    /// The size of a unit: of the first axis (WKT 2), or of all axes.
    fn factor(&self, units: &[&str]) -> Option<f64> {
        let of_axis = || self.child(&["AXIS"])?.child(units);
        let factor: f64 = self.child(units).or_else(of_axis)?.values.get(1)?.parse().ok()?;
        (factor.is_finite() && factor > 0.0).then_some(factor)
    }

    /// The EPSG code of this node itself, not of a node inside it.
    pub(super) fn code(&self) -> Option<u16> {
        let id = self.child(&["AUTHORITY", "ID"])?;
        match &id.values[..] {
            [authority, code, ..] if authority.eq_ignore_ascii_case("EPSG") => code.parse().ok(),
            _ => None,
        }
    }
}
