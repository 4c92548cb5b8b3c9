//! Arguments that are one name of a list of the core, or a number in its place.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use scansion_core::classes::ClassTable;
use scansion_core::classification::ClassifierKind;
use scansion_core::graph::Orientation;
use scansion_core::recipes::{Regularise, SegmentMethod};

/// Methods of segmentation.
pub(crate) fn segment_methods() -> impl TypedValueParser<Value = SegmentMethod> {
    choices(SegmentMethod::ALL, SegmentMethod::name, SegmentMethod::title)
}

/// Kinds of classifiers.
pub(crate) fn classifiers() -> impl TypedValueParser<Value = ClassifierKind> {
    choices(ClassifierKind::ALL, ClassifierKind::name, ClassifierKind::title)
}

/// Methods of regularisation.
pub(crate) fn regularisations() -> impl TypedValueParser<Value = Regularise> {
    choices(&Regularise::ALL, Regularise::name, Regularise::title)
}

/// A class: its code, or its name in the ASPRS list.
pub(crate) fn class_code(text: &str) -> Result<u8, String> {
    if let Ok(code) = text.trim().parse() {
        return Ok(code);
    }
    let wanted = text.trim().to_lowercase().replace(['_', '-'], " ");
    let listed = ClassTable::from_codes(&(0..=22).collect::<Vec<u8>>());
    let classes = listed.classes();
    if let Some(class) = classes.iter().find(|class| class.name.to_lowercase() == wanted) {
        return Ok(class.code);
    }
    let near = classes.iter().filter(|class| class.name.to_lowercase().contains(&wanted));
    let near: Vec<String> = near.map(|class| format!("{} {}", class.code, class.name)).collect();
    Err(match near.is_empty() || !wanted.starts_with(char::is_alphabetic) {
        true => "a class code, 0 to 255, or a name of the ASPRS list, e.g. building".into(),
        false => format!("a class code, or one of {}", near.join(", ")),
    })
}

/// Metres per unit: a number, or the name of a unit.
pub(crate) fn unit(text: &str) -> Result<f64, String> {
    match text.trim().to_lowercase().as_str() {
        "m" | "metre" | "metres" | "meter" | "meters" => Ok(1.0),
        "ft" | "foot" | "feet" => Ok(0.3048),
        "us-ft" | "us-foot" | "us-feet" | "ftus" => Ok(1200.0 / 3937.0),
        number => number.parse().map_err(|_| "metres per unit, e.g. 0.3048, or metres, feet, us-feet".into()),
    }
}

/// The side to which normals point: its name, or the position of the sensor.
pub(crate) fn orientation(text: &str) -> Result<Orientation, String> {
    match text.trim() {
        "up" => Ok(Orientation::Up),
        "spanning-tree" => Ok(Orientation::SpanningTree),
        numbers => {
            let found: Vec<f64> = numbers.split(',').map_while(|number| number.trim().parse().ok()).collect();
            let position = <[f64; 3]>::try_from(found).ok().filter(|_| numbers.split(',').count() == 3);
            position.map(Orientation::Sensor).ok_or_else(|| "up, spanning-tree, or a position X,Y,Z".into())
        }
    }
}

/// Parses the name of one of `all`; help shows the names with their titles.
fn choices<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
    title: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let values = all.iter().map(|&choice| PossibleValue::new(name(choice)).help(title(choice)));
    PossibleValuesParser::new(values).try_map(move |text| {
        let found = all.iter().copied().find(|&choice| name(choice) == text);
        found.ok_or_else(|| format!("{text} is not in the list"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_have_codes_or_names() {
        assert_eq!((class_code("6"), class_code("Building"), class_code("high_vegetation")), (Ok(6), Ok(6), Ok(5)));
        assert!(class_code("vegetation").unwrap_err().contains("3 low vegetation, 4 medium vegetation"));
        for wrong in ["256", "-1", "", "roof"] {
            assert!(class_code(wrong).unwrap_err().contains("0 to 255"), "{wrong}");
        }
    }

    #[test]
    fn units_have_numbers_or_names() {
        assert_eq!((unit("feet"), unit("0.3048"), unit("metres")), (Ok(0.3048), Ok(0.3048), Ok(1.0)));
        assert!(unit("0,3").is_err() && unit("yard").is_err());
    }

    #[test]
    fn orientations_have_names_or_positions() {
        assert_eq!(orientation("up"), Ok(Orientation::Up));
        assert_eq!(orientation("spanning-tree"), Ok(Orientation::SpanningTree));
        assert_eq!(orientation("-1, 2.5,3"), Ok(Orientation::Sensor([-1.0, 2.5, 3.0])));
        for wrong in ["down", "1,2", "1,2,3,4", "1,2,3,a", "1,,3", ""] {
            assert!(orientation(wrong).unwrap_err().contains("X,Y,Z"), "{wrong}");
        }
    }
}
