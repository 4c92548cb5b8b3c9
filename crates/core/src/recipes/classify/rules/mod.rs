//! Rules that change the classes of a model afterwards: vegetation is divided by its height, buildings without height
//! become ground, isolated points become noise, and wires get a class of their own. Cars, water, buildings too narrow to
//! be any, points of low confidence and those that the surroundings contradict become unclassified.

mod cars;
mod crossings;
mod decks;
mod level;
mod lying;
mod narrow;
mod plan;
mod raised;
mod spans;
mod water;
mod wires;

pub use cars::CarParams;
pub use decks::DeckParams;
pub use level::LevelParams;
pub use water::WaterParams;
pub use wires::WireParams;

use crate::classes::ClassTable;
use crate::cloud::{MetricCloud, Points, Positions};
use crate::error::{Error, Result};
use crate::parallel::{Looks, Monitor};
use crate::recipes::classify::Classified;
use crate::terrain::{HeightParams, heights_above};
use crate::voxels::cells::Cells;
use crate::voxels::rows::RowGrid;
use cars::Named;
use crossings::{Crossing, crossings};
use level::{Judged, LevelRows};
use lying::{Filtered, LyingRows, lying};
use narrow::narrow;
pub(in crate::recipes) use plan::plan_cell;
use raised::{Land, raised};
use serde::{Deserialize, Serialize};
use spans::{Scan, Span, spans};
use std::collections::HashSet;

/// ASPRS codes.
pub(in crate::recipes) const GROUND: u8 = 2;
pub(in crate::recipes) const LOW: u8 = 3;
const MEDIUM: u8 = 4;
const HIGH: u8 = 5;
pub(in crate::recipes) const BUILDING: u8 = 6;
const LOW_NOISE: u8 = 7;
const WIRE: u8 = 14;
const WATER: u8 = 9;
const HIGH_NOISE: u8 = 18;
/// Isolated points are noise if there is at most one of them in so many points.
const NOISE_SHARE: usize = 100;

/// Clouds of fewer points per square metre hide small bridges: a few points, like those of a dam.
const THIN: f64 = 2.0;
/// Places that a warning names, at most.
const NAMED: usize = 10;

/// Says where the decks of bridges may be.
fn bridges(scan: &Scan<'_>, free: u8, scene: &MetricCloud<'_>, monitor: &Monitor) -> Result<Vec<String>> {
    let Scan { points, codes, density, .. } = *scan;
    let land = Land { points, codes, free, density };
    let at = |row: u32| {
        let [x, y, _] = scene.cloud.xyz(points.frame.index[row as usize] as usize);
        format!("{x:.1} {y:.1}")
    };
    let over_water =
        spans(scan, monitor)?.into_iter().map(|Span { row, width }| format!("{} ({width:.0} m wide)", at(row)));
    let place = |Crossing { row, width, fall }| format!("{} ({width:.0} m wide, {fall:.1} m high)", at(row));
    let over_land: Vec<String> = crossings(&land, monitor)?.into_iter().map(place).collect();
    let warnings = [
        warning("ground between two areas without returns, perhaps water,", &over_water.collect::<Vec<_>>()),
        warning("a level way with lower ground on both sides", &over_land),
    ];
    Ok(warnings.into_iter().flatten().collect())
}

/// Names the first places.
fn warning(what: &str, places: &[String]) -> Option<String> {
    let more = match places.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let named = places[..places.len().min(NAMED)].join(", ");
    (!places.is_empty())
        .then(|| format!("{what} may be the deck of a bridge or a dam, and keeps its class: {named}{more}"))
}

/// Rules for the final codes of a model with ASPRS classes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClassRules {
    /// Heights above the ground, metres, ascending: vegetation (5) below the first becomes low (3), below the second
    /// medium (4). Empty: not divided. Only for models with the classes 2 and 5, but neither 3 nor 4.
    pub vegetation: Vec<f64>,
    /// Building points (6) less than this above the ground, metres, become ground: no building is as low. Those in less than six
    /// cells of 1 m that touch each other become unclassified, but not in clouds of less than 2.25 points per square metre: no
    /// building is as narrow. 0: neither. Only for models with the ASPRS classes 2 and 6.
    pub lowest_building: f64,
    /// Buildings (6) that are level with the ground around them become ground (hilltops) or unclassified (decks of short
    /// bridges, terraces); parts of them that lie on the ground of the ground filter are judged apart, and vegetation there of low
    /// confidence becomes ground. Only for models with the ASPRS classes 2 and 6.
    pub level: LevelParams,
    /// Buildings (6) that are the deck of a long bridge, and ground (2) that is the deck of a bridge over land or stands above
    /// all ground around it, become unclassified. Only for models with the ASPRS classes 2 and 6.
    pub decks: DeckParams,
    /// Ground (2) that is water becomes unclassified, or water (9), where it is found. Only for models with the ASPRS class 2
    /// and 5 or 6, but not 9.
    pub water: WaterParams,
    /// Vegetation, buildings (3 to 6) and unclassified points that are wires become wires (14). Only for models with the
    /// ASPRS classes 2 and 5, but not 14.
    pub wires: WireParams,
    /// Vegetation and buildings (3 to 6) that are cars become unclassified. Only for models that know cars.
    pub cars: CarParams,
    /// Points of less confidence become unclassified; 0..1.
    pub abstain: f64,
    /// Points with at most this many others in the 27 voxels around them become noise: low (7) below the ground, else
    /// high (18). 0: none. Only for models with the ASPRS class 2, and not for clouds so thin that more than a hundredth
    /// of all points would be noise.
    pub isolated: usize,
    /// Edge of these voxels, metres; above 0.
    pub noise_voxel: f64,
}

/// Points whose classes depend on their height.
struct Standing<'a> {
    /// Those of the model.
    classes: &'a ClassTable,
    points: &'a Points,
    /// Whether each of them is noise; empty: none is.
    isolated: Vec<bool>,
}

/// What is known when ground and buildings are divided.
struct Divided {
    /// Of each row of the points above those named ground, metres.
    heights: Vec<f32>,
    /// Rows of buildings that may be a deck, a terrace or the land around a pit.
    unknown: Vec<u32>,
}

impl Default for ClassRules {
    fn default() -> Self {
        Self {
            vegetation: Vec::new(),
            lowest_building: 0.0,
            level: LevelParams::none(),
            decks: DeckParams::none(),
            water: WaterParams::none(),
            wires: WireParams::none(),
            cars: CarParams::none(),
            abstain: 0.0,
            isolated: 0,
            noise_voxel: 4.0,
        }
    }
}

impl ClassRules {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// If a field is outside its range.
    pub fn validate(&self) -> Result<()> {
        let two = self.vegetation.len() == 2 && self.vegetation[0] <= self.vegetation[1];
        if !(self.vegetation.is_empty() || two && self.vegetation.iter().all(|h| h.is_finite())) {
            let found = format!("{:?}", self.vegetation);
            return Err(Error::parameter("classes.vegetation", found, "two heights in metres, ascending, or none"));
        }
        if !(self.lowest_building >= 0.0 && self.lowest_building.is_finite()) {
            return Err(Error::parameter("classes.lowest_building", self.lowest_building, "metres, 0 or more"));
        }
        self.level.validate()?;
        self.decks.validate()?;
        self.water.validate()?;
        self.wires.validate()?;
        self.cars.validate()?;
        if !(self.noise_voxel > 0.0 && self.noise_voxel.is_finite()) {
            return Err(Error::parameter("classes.noise_voxel", self.noise_voxel, "metres, above 0"));
        }
        match (0.0..=1.0).contains(&self.abstain) {
            true => Ok(()),
            false => Err(Error::parameter("classes.abstain", self.abstain, "a confidence, 0 to 1")),
        }
    }

    /// Whether these rules divide the vegetation of a model with these classes.
    pub fn divides(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.vegetation.len() == 2 && has(GROUND) && has(HIGH) && !has(LOW) && !has(MEDIUM)
    }

    /// Whether these rules find noise in the result of a model with these classes.
    pub fn finds_noise(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.isolated > 0 && has(GROUND) && !has(0) && !has(1) && !has(LOW_NOISE) && !has(HIGH_NOISE)
    }

    /// Whether these rules lower buildings to the ground in the result of a model with these classes.
    fn lowers(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.lowest_building > 0.0 && has(GROUND) && has(BUILDING)
    }

    /// Whether these rules look for buildings that are level with the ground in the result of a model with these classes.
    fn levels(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.level.search() && has(GROUND) && has(BUILDING)
    }

    /// Whether these rules look for decks of bridges in the result of a model with these classes.
    fn finds_decks(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.decks.length > 0.0 && has(GROUND) && has(BUILDING)
    }

    /// Whether these rules look for water in the ground of the result of a model with these classes.
    fn finds_water(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.water.area > 0.0 && has(GROUND) && (has(HIGH) || has(BUILDING)) && !has(WATER)
    }

    /// Whether these rules find wires in the result of a model with these classes.
    pub fn finds_wires(&self, classes: &ClassTable) -> bool {
        let has = |code| classes.position(code).is_some();
        self.wires.length > 0.0 && has(GROUND) && has(HIGH) && !has(WIRE)
    }

    /// All classes that can occur in the result of a model with these classes, besides the code of points without one.
    pub fn given(&self, classes: &ClassTable) -> ClassTable {
        let vegetation = if self.divides(classes) { vec![LOW, MEDIUM] } else { Vec::new() };
        let noise = if self.finds_noise(classes) { vec![LOW_NOISE, HIGH_NOISE] } else { Vec::new() };
        let wires = if self.finds_wires(classes) { vec![WIRE] } else { Vec::new() };
        let water = if self.water.named && self.finds_water(classes) { vec![WATER] } else { Vec::new() };
        let more = ClassTable::from_codes(&[vegetation, noise, wires, water].concat());
        let all = classes.classes().iter().chain(more.classes()).cloned().collect();
        ClassTable::new(all).unwrap_or_else(|_| classes.clone())
    }

    /// Applies the rules to a result; warns where bridges may be among the ground.
    pub(in crate::recipes) fn apply(
        &self,
        result: &mut Classified,
        classes: &ClassTable,
        scene: &MetricCloud<'_>,
        monitor: &Monitor,
    ) -> Result<()> {
        let by_height = self.divides(classes) || self.finds_noise(classes) || self.lowers(classes);
        let cars = self.cars.points > 0 && !result.cars.is_empty();
        let by_shape = self.levels(classes) || self.finds_decks(classes) || self.finds_wires(classes);
        if by_height || by_shape || cars || self.finds_water(classes) {
            let points = scene.points(monitor)?;
            if !points.is_empty() {
                let wet = self.by_surroundings(result, classes, &points, monitor)?;
                if self.finds_decks(classes) {
                    let scan = Scan { points: &points, codes: &result.codes, wet: &wet, density: result.density };
                    let found = bridges(&scan, classes.free_code(), scene, monitor)?;
                    result.warnings.extend(found);
                }
            }
        }
        if self.finds_decks(classes) && (f64::EPSILON..THIN).contains(&result.density) {
            result.warnings.push(format!(
                "{:.1} points per square metre: below {THIN:.0} not all decks of bridges are found, and the others are named ground, \
                 building or vegetation",
                result.density
            ));
        }
        if self.abstain > 0.0 {
            let free = classes.free_code();
            let unsure = result.codes.iter_mut().zip(&result.confidence).filter(|(_, c)| f64::from(**c) < self.abstain);
            unsure.for_each(|(code, _)| *code = free);
        }
        Ok(())
    }

    /// The rules that look at other points; returns the rows of the points on water.
    fn by_surroundings(
        &self,
        result: &mut Classified,
        classes: &ClassTable,
        points: &Points,
        monitor: &Monitor,
    ) -> Result<Vec<u32>> {
        let index = &points.frame.index;
        let Divided { heights, unknown } = self.divided(result, classes, points, monitor)?;
        // For at its ends a deck reaches the ground.
        let decks = match self.finds_decks(classes) {
            true => self.decks.rows(points, &result.codes, result.density, monitor)?,
            false => Vec::new(),
        };
        let free = classes.free_code();
        for row in unknown.into_iter().chain(decks) {
            let code = &mut result.codes[index[row as usize] as usize];
            *code = if *code == BUILDING { free } else { *code };
        }
        if self.finds_wires(classes) {
            let high = |&row: &u32| {
                let code = result.codes[index[row as usize] as usize];
                let open = (LOW..=BUILDING).contains(&code) || code == free;
                open && f64::from(heights[row as usize]) >= self.wires.height
            };
            let rows: Vec<u32> = (0..points.len() as u32).filter(high).collect();
            let wires = self.wires.among(&rows, points, monitor)?;
            wires.iter().for_each(|&row| result.codes[index[row as usize] as usize] = WIRE);
        }
        // After the wires, for the rims of decks look like some.
        if self.finds_decks(classes) {
            let land = Land { points, codes: &result.codes, free, density: result.density };
            let found = raised(&self.decks, &land, monitor)?;
            found.iter().for_each(|&row| result.codes[index[row as usize] as usize] = free);
        }
        if !result.cars.is_empty() {
            let (codes, cars, density) = (&result.codes, &result.cars, result.density);
            let found = self.cars.among(&Named { points, codes, cars, heights: &heights, density }, monitor)?;
            found.iter().for_each(|&row| result.codes[index[row as usize] as usize] = free);
        }
        if self.lowers(classes) {
            let found = narrow(points, &result.codes, result.density, monitor)?;
            found.iter().for_each(|&row| result.codes[index[row as usize] as usize] = free);
        }
        if self.finds_water(classes) {
            let water = if self.water.named { WATER } else { free };
            let found = self.water.rows(points, &result.codes, result.density, monitor)?;
            found.iter().for_each(|&row| result.codes[index[row as usize] as usize] = water);
            return Ok(found);
        }
        Ok(Vec::new())
    }

    /// Divides ground from buildings, and vegetation by its height.
    fn divided(
        &self,
        result: &mut Classified,
        classes: &ClassTable,
        points: &Points,
        monitor: &Monitor,
    ) -> Result<Divided> {
        let index = &points.frame.index;
        let named = result.codes.clone();
        let isolated = match self.finds_noise(classes) {
            true => self.isolated(&points.positions, monitor)?,
            false => Vec::new(),
        };
        let standing = Standing { classes, points, isolated };
        let heights = self.by_height(result, &standing, monitor)?;
        let LevelRows { mut ground, unknown, enclosing, .. } = self.level_rows(result, &named, &standing, monitor)?;
        let lying = self.lying_rows(result, &standing, monitor)?;
        let known: HashSet<u32> = unknown.iter().chain(&enclosing).copied().collect();
        ground.extend(lying.ground.into_iter().filter(|row| !known.contains(row)));
        let heights = match ground.is_empty() {
            true => heights,
            false => {
                drop(heights);
                result.codes = named;
                ground.iter().for_each(|&row| result.codes[index[row as usize] as usize] = GROUND);
                self.by_height(result, &standing, monitor)?
            }
        };
        // After the heights: what is not ground after all must not lower the roof around it.
        for row in lying.doubted.into_iter().filter(|row| !known.contains(row)) {
            let code = &mut result.codes[index[row as usize] as usize];
            *code = if (LOW..=BUILDING).contains(code) { GROUND } else { *code };
        }
        if !enclosing.is_empty() {
            result.warnings.push(format!(
                "{} points that look like roofs enclose the scan, and may as well be the land around a pit: they have no class; a \
                 scan that goes on around them tells",
                enclosing.len()
            ));
        }
        Ok(Divided { heights, unknown: [unknown, enclosing].concat() })
    }

    /// The buildings by the ground around them; `named` are the codes before low buildings became ground.
    fn level_rows(
        &self,
        result: &Classified,
        named: &[u8],
        standing: &Standing<'_>,
        monitor: &Monitor,
    ) -> Result<LevelRows> {
        let Standing { classes, points, .. } = *standing;
        if !self.levels(classes) {
            return Ok(LevelRows::default());
        }
        let found = |rule: &LevelParams, codes: &[u8]| {
            rule.rows(&Judged { points, codes, confidence: &[], density: result.density }, monitor)
        };
        // Ground that was named building joins the houses beside it to the ground, and is flush with it, until it is
        // ground again.
        let before = LevelParams { flush: 1.0, ..self.level.clone() };
        Ok(found(&before, named)?.revised(found(&self.level, &result.codes)?, points.len()))
    }

    /// What lies on the ground of the ground filter and is ground after all.
    fn lying_rows(&self, result: &Classified, standing: &Standing<'_>, monitor: &Monitor) -> Result<LyingRows> {
        let Standing { classes, points, .. } = *standing;
        if !self.levels(classes) || result.lying.is_empty() {
            return Ok(LyingRows::default());
        }
        let confidence: &[f32] = if result.is_regularised { &[] } else { &result.confidence };
        let scan = Judged { points, codes: &result.codes, confidence, density: result.density };
        lying(&Filtered { scan, lying: &result.lying }, &self.level, classes.free_code(), monitor)
    }

    /// The rules that need the height above the points that are named ground; returns these heights.
    fn by_height(&self, result: &mut Classified, standing: &Standing<'_>, monitor: &Monitor) -> Result<Vec<f32>> {
        let Standing { classes, points, ref isolated } = *standing;
        let index = &points.frame.index;
        let isolated = |row: usize| isolated.get(row).copied().unwrap_or(false);
        let ground = |(row, &point): (usize, &u32)| result.codes[point as usize] == GROUND && !isolated(row);
        let ground: Vec<bool> = index.iter().enumerate().map(ground).collect();
        let heights = heights_above(points, &ground, &HeightParams::default(), monitor)?;
        let (divides, lowers) = (self.divides(classes), self.lowers(classes));
        for (row, (&point, &height)) in index.iter().zip(&heights).enumerate() {
            let code = &mut result.codes[point as usize];
            *code = match f64::from(height) {
                h if isolated(row) => {
                    if h < 0.0 {
                        LOW_NOISE
                    } else {
                        HIGH_NOISE
                    }
                }
                h if lowers && *code == BUILDING && h < self.lowest_building => GROUND,
                _ if *code != HIGH || !divides => *code,
                h if h < self.vegetation[0] => LOW,
                h if h < self.vegetation[1] => MEDIUM,
                _ => HIGH,
            };
        }
        Ok(heights)
    }

    /// Whether each point has at most [`ClassRules::isolated`] others in the 27 voxels around it; empty in clouds that are too
    /// thin to say.
    fn isolated(&self, points: &Positions, monitor: &Monitor) -> Result<Vec<bool>> {
        let grid = RowGrid::new(points.iter(), self.noise_voxel, "classes.noise_voxel")?;
        let cells = Cells::new(points.len(), |i| grid.key(points.xyz(i)), monitor)?;
        let mut isolated = vec![false; points.len()];
        let mut looks = Looks::at(monitor);
        for c in 0..cells.len() {
            looks.step()?;
            let own = cells.of(c);
            // Most voxels hold enough themselves.
            if own.len() > self.isolated + 1 {
                continue;
            }
            let near: usize = cells.around(cells.keys[c]).map(|c| cells.range(c).len()).sum();
            if near <= self.isolated + 1 {
                own.iter().for_each(|&i| isolated[i as usize] = true);
            }
        }
        let thin = NOISE_SHARE * isolated.iter().filter(|&&alone| alone).count() > points.len();
        Ok(if thin { Vec::new() } else { isolated })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Cloud;

    #[test]
    fn vegetation_is_divided_by_its_height_and_unsure_points_are_set_free() {
        let mut rows: Vec<[f64; 3]> = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 100.0]).collect();
        rows.extend([[5.2, 5.2, 100.3], [5.2, 6.2, 101.0], [5.2, 7.2, 107.0], [8.2, 8.2, 104.0]]);
        // Far above and below.
        rows.extend([[9.0, 9.0, 180.0], [9.0, 9.0, 60.0], [3.4, 3.4, 100.02]]);
        let cloud = Cloud::from_rows(&rows).unwrap();
        let scene = MetricCloud::new(&cloud, None, &Monitor::default()).unwrap();
        let mut result = Classified {
            codes: [vec![2; 400], vec![5, 5, 5, 6, 6, 2, 6]].concat(),
            confidence: [vec![0.9; 403], vec![0.4, 0.9, 0.9, 0.9]].concat(),
            ..Classified::default()
        };
        let classes = ClassTable::from_codes(&[2, 5, 6]);
        let rules = ClassRules {
            vegetation: vec![0.5, 1.5],
            lowest_building: 0.3,
            abstain: 0.5,
            isolated: 5,
            ..ClassRules::default()
        };
        rules.validate().unwrap();
        rules.apply(&mut result, &classes, &scene, &Monitor::default()).unwrap();
        assert_eq!(result.codes[400..], [3, 4, 5, 1, 18, 7, 2]);
        assert!(result.codes[..400].iter().all(|&code| code == 2));
        assert_eq!(rules.given(&classes).len(), 7);
        assert!(!rules.divides(&ClassTable::from_codes(&[2, 3, 5])));
        assert!(ClassRules { vegetation: vec![1.0], ..rules.clone() }.validate().is_err());
        assert!(ClassRules { abstain: 1.5, ..rules }.validate().is_err());
    }

    #[test]
    fn a_house_on_a_slope_stays_building_in_thin_clouds_and_the_ground_around_it_becomes_ground() {
        let slope = |x: f64| 0.5 * x;
        let inside = |x: f64, y: f64, reach: f64| (x - 50.0).abs() < 6.0 + reach && (y - 30.0).abs() < 5.0 + reach;
        // 0.7 points a square metre, by the sequence of Roberts 2018 with the plastic number.
        let place =
            |i: u32| [100.0 * (f64::from(i) * 0.754_877_666).fract(), 60.0 * (f64::from(i) * 0.569_840_291).fract()];
        let rows: Vec<[f64; 3]> = (0..4200)
            .map(place)
            .map(|[x, y]| [x, y, if inside(x, y, 0.0) { slope(50.0) + 6.0 } else { slope(x) }])
            .collect();
        // Ground up to 8 m beside the house was named building.
        let codes = rows.iter().map(|&[x, y, _]| if inside(x, y, 8.0) { BUILDING } else { GROUND }).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let scene = MetricCloud::new(&cloud, None, &Monitor::default()).unwrap();
        let mut result = Classified { codes, confidence: vec![1.0; 4200], density: 0.7, ..Classified::default() };
        let rules = ClassRules { level: LevelParams::default(), lowest_building: 0.3, ..ClassRules::default() };
        rules.apply(&mut result, &ClassTable::from_codes(&[2, 5, 6]), &scene, &Monitor::default()).unwrap();
        let share = |of_house: bool, code: u8| {
            let those = rows.iter().zip(&result.codes).filter(|(row, _)| inside(row[0], row[1], 0.0) == of_house);
            let (all, found) =
                those.fold((0, 0), |(all, found), (_, &own)| (all + 1, found + usize::from(own == code)));
            f64::from(found as u32) / f64::from(all)
        };
        let (house, ground) = (share(true, BUILDING), share(false, GROUND));
        assert!(house > 0.95 && ground > 0.95, "{house} {ground}");
    }

    /// Codes of 120 x 60 m, 4 points a square metre, by the rules: a bridge, named building, over a ditch, and a pond with few
    /// returns in the ground.
    fn bridge_and_pond(rules: &ClassRules) -> [Vec<u8>; 3] {
        let bridge = |x: f64, y: f64| x < 60.0 && (y - 30.0).abs() < 3.0 && (x - 30.0).abs() < 14.0;
        let pond = |x: f64, y: f64| (x - 90.0).hypot(y - 30.0) < 15.0;
        let rows: Vec<[f64; 3]> = (0..28_800)
            .map(|i| (i % 240, i / 240))
            .filter(|(x, y)| !pond(f64::from(*x) / 2.0, f64::from(*y) / 2.0) || x % 3 == 0 && y % 3 == 0)
            .map(|(x, y)| [f64::from(x) / 2.0, f64::from(y) / 2.0])
            .map(|[x, y]| match () {
                () if bridge(x, y) => [x, y, 0.0],
                () if pond(x, y) => [x, y, -0.5],
                () => [x, y, ((x - 30.0).abs() - 12.0).clamp(-4.0, 0.0)],
            })
            .collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let code = |&[x, y, _]: &[f64; 3]| if bridge(x, y) { BUILDING } else { GROUND };
        let mut result = Classified {
            codes: rows.iter().map(code).collect(),
            confidence: vec![0.9; rows.len()],
            density: 4.0,
            ..Classified::default()
        };
        let scene = MetricCloud::new(&cloud, None, &Monitor::default()).unwrap();
        rules.apply(&mut result, &ClassTable::from_codes(&[2, 5, 6]), &scene, &Monitor::default()).unwrap();
        let of = |part: &dyn Fn(f64, f64) -> bool| {
            rows.iter().zip(&result.codes).filter(|([x, y, _], _)| part(*x, *y)).map(|(_, &code)| code).collect()
        };
        [of(&bridge), of(&pond), of(&|x, y| !bridge(x, y) && !pond(x, y))]
    }

    #[test]
    fn decks_and_water_become_unclassified_unless_the_rules_are_off() {
        let share =
            |codes: &[u8], code: u8| codes.iter().filter(|&&own| own == code).count() as f64 / codes.len() as f64;
        let rules = ClassRules { decks: DeckParams::default(), water: WaterParams::default(), ..ClassRules::default() };
        let [bridge, pond, land] = bridge_and_pond(&rules);
        // Cells that are half land are not water.
        assert!(share(&bridge, 1) > 0.95 && share(&pond, 1) > 0.75, "{} {}", share(&bridge, 1), share(&pond, 1));
        assert!(land.iter().all(|&code| code == GROUND));
        let named = ClassRules { water: WaterParams { named: true, ..WaterParams::default() }, ..rules };
        assert!(named.given(&ClassTable::from_codes(&[2, 6])).position(WATER).is_some());
        let [bridge, pond, _] = bridge_and_pond(&named);
        assert!(share(&bridge, 1) > 0.95 && share(&pond, WATER) > 0.75);
        let [bridge, pond, _] = bridge_and_pond(&ClassRules::default());
        assert!(share(&bridge, BUILDING) == 1.0 && share(&pond, GROUND) == 1.0);
    }
    #[test]
    fn thin_clouds_are_said_to_hide_bridges_in_the_ground() {
        let warnings = |spacing: f64, rules: &ClassRules| {
            let rows: Vec<[f64; 3]> =
                (0..900).map(|i| [f64::from(i % 30) * spacing, f64::from(i / 30) * spacing, 0.0]).collect();
            let cloud = Cloud::from_rows(&rows).unwrap();
            let scene = MetricCloud::new(&cloud, None, &Monitor::default()).unwrap();
            let density = spacing.powi(-2);
            let (codes, confidence) = (vec![GROUND; rows.len()], vec![0.9; rows.len()]);
            let mut result = Classified { codes, confidence, density, ..Classified::default() };
            rules.apply(&mut result, &ClassTable::from_codes(&[2, 5, 6]), &scene, &Monitor::default()).unwrap();
            result.warnings
        };
        let rules = ClassRules { decks: DeckParams::default(), ..ClassRules::default() };
        let thin = warnings(2.0, &rules);
        assert!(
            thin.len() == 1 && thin[0].contains("0.2 points per square metre: below 2 not all decks of bridges"),
            "{thin:?}"
        );
        assert!(warnings(0.5, &rules).is_empty() && warnings(2.0, &ClassRules::default()).is_empty());
    }

    #[test]
    fn a_warning_names_the_place_of_a_bridge_in_the_units_of_the_file() {
        // In feet: a canal without points, 15 m wide, and a bridge of 6 m across it.
        const FOOT: f64 = 0.3048;
        let places = (0..57_600).map(|i| [f64::from(i % 240) / 2.0 + 0.2, f64::from(i / 240) / 2.0 + 0.2]);
        let height = |[x, y]: [f64; 2]| match ((y - 60.0).abs() < 7.5, (x - 60.0).abs() < 3.0) {
            (false, _) => Some(0.0),
            (true, true) => Some(1.2),
            (true, false) => None,
        };
        let feet = |[x, y]: [f64; 2], z: f64| [10_000.0 + x / FOOT, 20_000.0 + y / FOOT, z / FOOT];
        let rows: Vec<[f64; 3]> = places.filter_map(|place| height(place).map(|z| feet(place, z))).collect();
        let cloud = Cloud::from_rows(&rows).unwrap();
        let scene = MetricCloud::new(&cloud, Some(FOOT), &Monitor::default()).unwrap();
        let (codes, confidence) = (vec![GROUND; rows.len()], vec![0.9; rows.len()]);
        let mut result = Classified { codes, confidence, density: 4.0, ..Classified::default() };
        let rules = ClassRules { decks: DeckParams::default(), ..ClassRules::default() };
        rules.apply(&mut result, &ClassTable::from_codes(&[2, 5, 6]), &scene, &Monitor::default()).unwrap();
        let [warning] = &result.warnings[..] else { panic!("{:?}", result.warnings) };
        let words = warning.split([' ', '(']);
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        let [x, y, width] = numbers[..] else { panic!("{warning}") };
        let [x, y] = [(x - 10_000.0) * FOOT, (y - 20_000.0) * FOOT];
        assert!((x - 60.0).abs() < 3.5 && (y - 60.0).abs() < 8.0, "{warning}");
        assert!((width - 6.0).abs() < 1.5, "{warning}");
        assert!(result.codes.iter().all(|&code| code == GROUND));
    }
}
