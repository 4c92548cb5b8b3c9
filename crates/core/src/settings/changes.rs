//! Settings on top of others: TOML in which only some keys are written, and single settings `a.b.c=value`.

use crate::error::{Error, Result};
use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// Largest number of parts of a key; those of recipes have up to five.
const DEEPEST: usize = 16;

/// Sets each `a.b.c=value`, one after the other, in a TOML table in which all values are written out, and reads the result.
///
/// A choice that has values of its own is a table of one key, its name. The name of another choice takes its place; all
/// values of the new one can be set, each by itself: `optimiser.sgd.momentum=0.9`, then `optimiser.sgd.decay=0.01`.
///
/// A section of one key looks like a choice too, so that a wrong key in it would give way to the right one that follows.
/// Each setting is therefore read by itself first; it may lack values of its choice, which others can give.
///
/// # Errors
/// If a setting has no `=`, an empty key, or a key of too many parts; as `read`.
pub(crate) fn with_keys<'a, T>(
    table: &Table,
    settings: impl IntoIterator<Item = &'a str>,
    read: impl Fn(Table) -> Result<T>,
) -> Result<T> {
    let before = Value::Table(table.clone());
    let mut all = table.clone();
    for setting in settings {
        let given = parsed(setting)?;
        let mut alone = table.clone();
        put(&mut alone, given.clone(), Some(&before));
        if let Some(wrong) = read(alone).err().filter(|e| !e.to_string().contains("missing field")) {
            return Err(wrong);
        }
        put(&mut all, given, Some(&before));
    }
    read(all)
}

/// A setting as a table.
fn parsed(setting: &str) -> Result<Table> {
    let bad = || Error::parameter("set", setting, "key=value, e.g. forest.trees=100");
    let (key, value) = setting.split_once('=').ok_or_else(bad)?;
    let parts: Vec<&str> = key.trim().split('.').take(DEEPEST + 1).collect();
    if parts.len() > DEEPEST {
        let start: String = key.trim().chars().take(40).collect();
        return Err(Error::parameter("set", format!("{start}..."), format!("a key of at most {DEEPEST} parts")));
    }
    if parts.iter().any(|part| part.is_empty()) {
        return Err(bad());
    }
    let within = |value, part: &&str| Value::Table(Table::from_iter([((*part).to_string(), value)]));
    match parts.iter().rev().fold(parse_value(value.trim()), within) {
        Value::Table(table) => Ok(table),
        _ => Err(bad()),
    }
}

fn parse_value(text: &str) -> Value {
    let read = format!("v = {text}").parse::<Table>().ok().and_then(|mut t| t.remove("v"));
    read.or_else(|| short_number(text)).unwrap_or_else(|| Value::String(text.to_string()))
}

/// A number such as `.9` or `1.`, which TOML does not have.
fn short_number(text: &str) -> Option<Value> {
    let digits = text.trim_start_matches(['+', '-']);
    let short = digits.starts_with('.') || digits.ends_with('.');
    text.parse().ok().filter(|_| short).map(Value::Float)
}

/// Reads TOML; error messages give the place and suggest the intended key.
pub(crate) fn explained<T: DeserializeOwned>(text: &str) -> Result<T> {
    toml::from_str(text).map_err(|e| Error::input(format!("recipe: {}", explain(&e.to_string()))))
}

/// Reads TOML like [`explained`]; values not given are those of `defaults`, in the tables in it too.
pub(crate) fn with_defaults<T: DeserializeOwned + Serialize>(text: &str, defaults: &T) -> Result<T> {
    let written: T = explained(text)?;
    let given: Table = text.parse().map_err(|e| Error::input(format!("recipe: {e}")))?;
    let mut all = Table::try_from(defaults).map_err(|e| Error::input(format!("recipe: {e}")))?;
    let before = Value::Table(all.clone());
    put(&mut all, given, Some(&before));
    Ok(read(&all).unwrap_or(written))
}

/// Settings on top of these, which need no line of a text to be named in errors.
///
/// # Errors
/// As [`with_keys`]; if a key is unknown, or a value has the wrong type.
pub(crate) fn changed<'a, T: DeserializeOwned + Serialize>(
    settings: &T,
    changes: impl IntoIterator<Item = &'a str>,
) -> Result<T> {
    let table = Table::try_from(settings).map_err(|e| Error::input(format!("settings: {e}")))?;
    let wrong = |e: toml::de::Error| Error::input(format!("settings: {}", explain(e.message())));
    with_keys(&table, changes, |table| read(&table).map_err(wrong))
}

/// Reads a table by way of its text. `Table::try_into` would compile a second reader of all settings, a twentieth of the
/// program. Errors name a place in that text, which nobody has seen; [`toml::de::Error::message`] is without it.
pub(crate) fn read<T: DeserializeOwned>(table: &Table) -> std::result::Result<T, toml::de::Error> {
    toml::from_str(&table.to_string())
}

/// Puts the given values into a table. `before` is that table with all values written out, from which it is known where a
/// choice is; `None` among the values of a choice that was not there before.
fn put(table: &mut Table, given: Table, before: Option<&Value>) {
    for (key, value) in given {
        let own = before.and_then(|before| before.get(&key));
        match (table.get_mut(&key), value) {
            (Some(Value::Table(here)), Value::Table(value)) => {
                if let Some(own) = own {
                    choose(here, &value, own);
                }
                put(here, value, own);
            }
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

/// Makes room for another choice than that of the table. A choice is a word, or a table of one key if it has values of its
/// own; that of `before` has them again when it comes back.
fn choose(table: &mut Table, given: &Table, before: &Value) {
    let choice = before.as_table().is_none_or(|values| values.len() == 1);
    let other = given.keys().all(|key| !table.contains_key(key));
    if choice && given.len() == 1 && other {
        let known = before.as_table().filter(|values| given.keys().all(|key| values.contains_key(key)));
        *table = known.cloned().unwrap_or_default();
    }
}

/// The message of the TOML reader about an unknown value of a choice in the words of serde's about an unknown field.
fn like_serde(message: &str) -> String {
    let parts = message.split_once("unexpected keys in table: ");
    let Some((before, (wrong, valid))) =
        parts.and_then(|(at, keys)| Some((at, keys.split_once(", available keys: ")?)))
    else {
        return message.to_string();
    };
    let quoted = |keys: &str| keys.trim().split(", ").map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
    format!("{before}unknown field {}, expected {}", quoted(wrong), quoted(valid))
}

/// Adds "did you mean" to serde's message about an unknown field.
fn explain(message: &str) -> String {
    let message = &like_serde(message);
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    match (message.contains("unknown field"), quoted.split_first()) {
        (true, Some((wrong, valid))) => match valid.iter().min_by_key(|v| strsim::levenshtein(wrong, v)) {
            Some(near) => format!("{}\nhelp: did you mean `{near}`?", message.trim_end()),
            None => message.to_string(),
        },
        _ => message.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    /// All values of some settings: a choice with values, one that is a word, a section.
    const ALL: &str =
        "rate = 0.1\nshare = \"sqrt\"\n[how.adam]\nfirst = 0.9\nsecond = 0.5\n[section]\none = 1\ntwo = 2\n";

    fn set(settings: &[&str]) -> Table {
        with_keys(&ALL.parse().unwrap(), settings.iter().copied(), Ok).unwrap()
    }

    #[test]
    fn all_values_of_another_choice_can_be_set_one_by_one() {
        let how = |settings: &[&str], expected: &str| {
            assert_eq!(set(settings)["how"], expected.parse::<Table>().unwrap()["how"], "{settings:?}");
        };
        how(&["how.sgd.momentum=0.9", "how.sgd.decay=0"], "how.sgd = { momentum = 0.9, decay = 0 }");
        how(&["how.sgd={ momentum = 0.9 }", "how.sgd.decay=0"], "how.sgd = { momentum = 0.9, decay = 0 }");
        how(&["how.sgd={}"], "how.sgd = {}");
        how(&["how.adam.first=0.8"], "how.adam = { first = 0.8, second = 0.5 }");
        // The last choice counts, with its own values.
        how(&["how.sgd.momentum=0.9", "how.grad.small=1"], "how.grad = { small = 1 }");
        how(&["how.sgd.momentum=0.9", "how.adam.first=0.8"], "how.adam = { first = 0.8, second = 0.5 }");
    }

    #[test]
    fn a_word_gives_way_to_a_choice_with_values_and_comes_back() {
        let share = |settings: &[&str], expected: &str| {
            assert_eq!(set(settings)["share"], parse_value(expected), "{settings:?}");
        };
        share(&["share.count=3"], "{ count = 3 }");
        share(&["share.count=3", "share.part=0.5"], "{ part = 0.5 }");
        share(&["share.count=3", "share=all"], "all");
    }

    #[test]
    fn values_of_a_section_stay_and_wrong_keys_are_added_to_them() {
        assert_eq!(set(&["section.one=3"])["section"], parse_value("{ one = 3, two = 2 }"));
        assert_eq!(set(&["section.on=3"])["section"], parse_value("{ one = 1, two = 2, on = 3 }"));
    }

    /// Settings with a choice and a section of one key.
    #[derive(Debug, Deserialize, PartialEq, Serialize)]
    #[serde(deny_unknown_fields)]
    struct Settings {
        how: How,
        shares: Shares,
    }

    #[derive(Debug, Deserialize, PartialEq, Serialize)]
    #[serde(rename_all = "kebab-case", deny_unknown_fields)]
    enum How {
        Plain,
        Adam { first: f64 },
        Sgd { momentum: f64, decay: f64 },
    }

    #[derive(Debug, Deserialize, PartialEq, Serialize)]
    #[serde(deny_unknown_fields)]
    struct Shares {
        power: f64,
    }

    #[test]
    fn a_wrong_key_is_refused_even_if_a_later_setting_takes_its_place() {
        let settings = Settings { how: How::Adam { first: 0.9 }, shares: Shares { power: 0.5 } };
        for (wrong, right, named) in [
            ("shares.pwer=1", "shares.power=2", "pwer"),
            ("shares.pwer=1", "shares={ power = 2 }", "pwer"),
            ("how.sgd.momentm=1", "how.adam.first=0.5", "momentm"),
            ("how.sdg.momentum=1", "how.adam.first=0.5", "sdg"),
            ("how.sdg.momentum=1", "how=plain", "sdg"),
            ("share.power=1", "shares.power=2", "share"),
        ] {
            for order in [[wrong, right], [right, wrong]] {
                let message = changed(&settings, order).unwrap_err().to_string();
                assert!(message.contains(&format!("`{named}`")), "{order:?}: {message}");
                let near = if named == "momentm" { "did you mean `momentum`?" } else { "" };
                assert!(message.contains(near), "{order:?}: {message}");
            }
        }
        let set = |keys: &[&str]| changed(&settings, keys.iter().copied()).unwrap();
        assert_eq!(set(&["shares.power=1", "shares.power=2"]).shares, Shares { power: 2.0 });
        assert_eq!(set(&["how.sgd.momentum=1", "how.sgd.decay=0"]).how, How::Sgd { momentum: 1.0, decay: 0.0 });
        assert_eq!(set(&["how.sgd.momentum=1", "how.adam.first=0.5"]).how, How::Adam { first: 0.5 });
        assert_eq!(set(&["how.sgd.momentum=1", "how=plain"]).how, How::Plain);
    }

    #[test]
    fn numbers_need_no_digit_on_both_sides_of_the_point() {
        let rate = |text: &str| set(&[&format!("rate={text}")])["rate"].clone();
        for (text, expected) in [(".9", 0.9), ("-.5", -0.5), ("1.", 1.0), ("2.5e-3", 2.5e-3)] {
            assert_eq!(rate(text), Value::Float(expected), "{text}");
        }
        for text in [".", "a.", "-", "1.2.", "v1"] {
            assert_eq!(rate(text), Value::String(text.into()));
        }
    }
}
