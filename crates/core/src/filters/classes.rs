//! Filter by class codes.

use super::FilterParams;
use crate::cloud::{Cloud, names};
use crate::error::{Error, Result};
use crate::parallel::Monitor;

/// Whether each point has one of the classes to keep and none of those to drop.
///
/// A class to keep or to drop that no point has is warned about.
pub(super) fn of_classes(cloud: &Cloud, params: &FilterParams, monitor: &Monitor) -> Result<Vec<bool>> {
    let Some(column) = cloud.column(names::CLASSIFICATION) else {
        return Err(Error::input("the cloud has no classes: classify it first"));
    };
    let mut found = [false; 256];
    let mut kept = Vec::with_capacity(cloud.len());
    for piece in crate::parallel::watched(cloud.len(), monitor) {
        kept.extend(piece?.map(|i| {
            let code = code(column.values.get(i));
            code.iter().for_each(|&code| found[usize::from(code)] = true);
            let wanted = params.classes.is_empty() || code.is_some_and(|code| params.classes.contains(&code));
            wanted && !code.is_some_and(|code| params.drop_classes.contains(&code))
        }));
    }
    let asked = params.classes.iter().chain(&params.drop_classes);
    let absent: Vec<String> = asked.filter(|&&code| !found[usize::from(code)]).map(u8::to_string).collect();
    if !absent.is_empty() && !cloud.is_empty() {
        monitor.warn(format!("no point has class {}", absent.join(", ")));
    }
    Ok(kept)
}

/// The class code that a value means, if it is one.
fn code(value: f64) -> Option<u8> {
    let rounded = value.round();
    ((0.0..=255.0).contains(&rounded)).then_some(rounded as u8)
}
