//! A confusion matrix and its scores as text, JSON and CSV.

use super::Confusion;
use crate::error::{Error, Result};
use std::fmt::Write;

/// Aligned plain text: scores per class, means, then the matrix in percent of each true class.
pub fn to_table(confusion: &Confusion) -> String {
    let s = confusion.scores();
    let width = s.labels.iter().map(|l| l.name.len()).max().unwrap_or(5).max(5);
    let mut text = format!(
        "{:>4}  {:<width$} {:>9} {:>9} {:>9} {:>9} {:>12}\n",
        "code", "class", "IoU", "precision", "recall", "F1", "points"
    );
    for l in &s.labels {
        let values = [l.intersection_over_union, l.precision, l.recall, l.f1_score]
            .map(|v| format!("{:>9.2}", 100.0 * v))
            .join(" ");
        let _ = writeln!(text, "{:>4}  {:<width$} {values} {:>12}", l.code, l.name, l.support);
    }
    let means = [
        ("overall accuracy", s.overall_accuracy),
        ("mean IoU", s.mean_intersection_over_union),
        ("mean F1", s.mean_f1_score),
        ("kappa", s.kappa),
    ];
    let means = means.map(|(name, value)| format!("{name} {}", percent(value)));
    let _ = writeln!(
        text,
        "\n{}  (all in percent, {} points, {} skipped as unlabelled)",
        means.join(", "),
        s.points,
        s.skipped
    );
    let codes = |codes: Vec<u8>| codes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let others: Vec<u8> = s.labels.iter().map(|l| l.code).filter(|code| !s.mean_over.contains(code)).collect();
    let without = if others.is_empty() { String::new() } else { format!(", without {}", codes(others)) };
    let _ = writeln!(text, "means over the classes {}{without}", codes(s.mean_over));
    let _ = writeln!(text, "\nrow: true class, column: named so, percent of the row");
    text + &matrix(confusion, width)
}

fn matrix(confusion: &Confusion, width: usize) -> String {
    let classes = confusion.classes().classes();
    let mut text = format!("{:>4}  {:<width$}", "", "");
    classes.iter().for_each(|c| {
        let _ = write!(text, " {:>7}", c.code);
    });
    text.push('\n');
    for (t, class) in classes.iter().enumerate() {
        let _ = write!(text, "{:>4}  {:<width$}", class.code, class.name);
        for p in 0..classes.len() {
            let share = 100.0 * confusion.count(t, p) as f64 / confusion.support(t).max(1) as f64;
            let _ = write!(text, " {share:>7.2}");
        }
        text.push('\n');
    }
    text
}

/// A share in percent; `-` if it is not defined.
pub fn percent(share: f64) -> String {
    if share.is_nan() { "-".into() } else { format!("{:.2}", 100.0 * share) }
}

/// All scores as JSON; null stands for those that are not defined.
///
/// # Errors
/// If the JSON encoder fails.
pub fn to_json(confusion: &Confusion) -> Result<String> {
    serde_json::to_string_pretty(&confusion.scores())
        .map_err(|e| Error::input(format!("scores cannot be written as JSON: {e}")))
}

/// CSV: one line a class, then the means; those that are not defined are empty.
pub fn to_csv(confusion: &Confusion) -> String {
    let s = confusion.scores();
    let mut text = "code,class,precision,recall,f1_score,intersection_over_union,support\n".to_string();
    for l in &s.labels {
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{}",
            l.code,
            csv_field(&l.name),
            l.precision,
            l.recall,
            l.f1_score,
            l.intersection_over_union,
            l.support
        );
    }
    let number = |v: f64| if v.is_nan() { String::new() } else { v.to_string() };
    let [accuracy, f1, iou] = [s.overall_accuracy, s.mean_f1_score, s.mean_intersection_over_union].map(number);
    let _ = writeln!(text, ",overall_accuracy,{accuracy},{accuracy},,,{}", s.points);
    let _ = writeln!(text, ",mean,,,{f1},{iou},");
    text
}

/// A field of a CSV table (RFC 4180): quoted if it contains a comma, a quotation mark or a line end.
pub fn csv_field(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_csv_are_quoted_where_they_must_be() {
        assert_eq!(["a b", "a, b", "5\" pipe"].map(csv_field), ["a b", "\"a, b\"", "\"5\"\" pipe\""]);
    }

    #[test]
    fn reports_hold_the_numbers_and_the_documented_keys() {
        let confusion = Confusion::from_labels(&[2, 2, 2, 6, 1], &[2, 2, 6, 6, 2], &[1]).unwrap();
        let table = to_table(&confusion);
        let other = to_table(&Confusion::from_labels(&[2, 2, 6], &[2, 7, 6], &[]).unwrap());
        assert!(other.contains("means over the classes 2, 6, without 7"), "{other}");
        assert!(table.contains("overall accuracy 75.00") && table.contains("1 skipped"), "{table}");
        let ground: Vec<&str> = table.lines().find(|l| l.contains("ground")).unwrap().split_whitespace().collect();
        assert_eq!(ground, ["2", "ground", "66.67", "100.00", "66.67", "80.00", "3"]);
        let json: serde_json::Value = serde_json::from_str(&to_json(&confusion).unwrap()).unwrap();
        assert_eq!(json["confusion_matrix"], serde_json::json!([[2, 1], [0, 1]]));
        for key in ["precision", "recall", "f1_score", "intersection_over_union", "support"] {
            assert!(json["labels"][0][key].is_number(), "{key}");
        }
        for key in ["overall_accuracy", "mean_intersection_over_union", "mean_f1_score", "kappa"] {
            assert!(json[key].is_number(), "{key}");
        }
        assert_eq!(to_csv(&confusion).lines().count(), 5);
        // One class: no agreement beyond chance; and means over a class that does not occur.
        let one = Confusion::from_labels(&[2, 2], &[2, 2], &[]).unwrap().with_means_over(&[9]);
        let table = to_table(&one);
        assert!(table.contains("overall accuracy 100.00, mean IoU -, mean F1 -, kappa -  (all"), "{table}");
        let json: serde_json::Value = serde_json::from_str(&to_json(&one).unwrap()).unwrap();
        assert!(json["kappa"].is_null() && json["mean_f1_score"].is_null());
        assert!(to_csv(&one).ends_with(",mean,,,,,\n"), "{}", to_csv(&one));
    }
}
