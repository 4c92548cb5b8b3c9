//! Shared by the benches: settings and tables given by environment variables.

/// What a bench may fail with.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// The number that a variable holds, or the default.
#[must_use]
pub fn number(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// The bytes of the file that a variable names.
///
/// # Errors
/// If the variable is not set or the file cannot be read.
pub fn file(name: &str) -> Result<Vec<u8>> {
    let path = std::env::var(name).map_err(|_| format!("{name} is not set"))?;
    Ok(std::fs::read(path)?)
}

/// The same, four bytes at a time.
///
/// # Errors
/// As of [`file()`].
pub fn words(name: &str) -> Result<Vec<[u8; 4]>> {
    Ok(file(name)?.as_chunks().0.to_vec())
}

/// Features (`SCANSION_FEATURES`, f32, row by row) and labels (`SCANSION_LABELS`, bytes) of some rows.
pub struct Table {
    /// Features row by row.
    pub values: Vec<f32>,
    /// Features a row (`SCANSION_WIDTH`).
    pub width: usize,
    /// Label of each row.
    pub labels: Vec<u16>,
    /// Largest label plus 1.
    pub classes: usize,
}

impl Table {
    /// Reads what the environment names.
    ///
    /// # Errors
    /// If a variable is not set or a file cannot be read.
    pub fn read() -> Result<Self> {
        let values = words("SCANSION_FEATURES")?.into_iter().map(f32::from_le_bytes).collect();
        let labels: Vec<u16> = file("SCANSION_LABELS")?.into_iter().map(u16::from).collect();
        let classes = labels.iter().max().map_or(1, |&l| usize::from(l) + 1);
        Ok(Self { values, width: number("SCANSION_WIDTH", 144), labels, classes })
    }
}
