//! Messages of the core, which names options of the command line, in the words of Python.

/// What the core says, and what Python says instead.
const WORDS: [(&str, &str); 11] = [
    ("others need a --map, e.g. ", "others need a class_map, e.g. "),
    ("(--unit METRES, or metres_per_unit in Python)", "(metres_per_unit)"),
    ("use --unit 0.3048", "use metres_per_unit=0.3048"),
    ("(--unit 0.001)", "(metres_per_unit=0.001)"),
    ("(--unit)", "(metres_per_unit)"),
    ("(--columns names them)", "(text_columns names them)"),
    ("(convert --bounds)", "(bounds of scansion.read)"),
    (
        "not looked for: cars, water and decks of bridges",
        "`classify` finds some of them and names places that may be decks of bridges",
    ),
    ("`scansion train` makes models of such clouds", "`PointClassifier.fit` makes models of such clouds"),
    ("`scansion train` makes models with other classes", "`PointClassifier.fit` makes models with other classes"),
    ("(features --list has all)", "(scansion.features.definitions() has all)"),
];

/// The message with what Python calls the options in it.
pub(crate) fn in_python(message: &str) -> String {
    WORDS.iter().fold(message.to_string(), |text, (said, instead)| text.replace(*said, instead))
}

#[cfg(test)]
mod tests {
    use super::in_python;

    #[test]
    fn options_have_their_names_in_python() {
        assert_eq!(in_python("one unit? (--unit)"), "one unit? (metres_per_unit)");
        assert_eq!(in_python("no option: --unit of another program"), "no option: --unit of another program");
    }
}
