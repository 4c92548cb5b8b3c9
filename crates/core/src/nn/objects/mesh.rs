//! OFF files, in which ModelNet comes, and points on the surfaces of meshes.

use crate::error::{Error, Result};
use crate::io::open;
use crate::random::stream;
use std::path::Path;

/// Bytes of a file that is read, at most.
const MOST: u64 = 4 << 30;

/// A mesh of triangles, which need not be closed.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The vertices.
    pub vertices: Vec<[f64; 3]>,
    /// Numbers of the vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Points on the surface, each place with the same chance: whether the mesh is closed, or its normals point outwards,
    /// does not matter. The same seed gives the same points.
    ///
    /// # Errors
    /// If no triangle has an area, or one has a vertex that does not exist.
    pub fn sampled(&self, count: usize, seed: u64) -> Result<Vec<[f64; 3]>> {
        if let Some(wrong) = self.triangles.iter().flatten().find(|&&v| v as usize >= self.vertices.len()) {
            let allowed = format!("below {}", self.vertices.len());
            return Err(Error::input(format!("a triangle with vertex {wrong} (allowed: {allowed})")));
        }
        let mut sums: Vec<f64> = Vec::with_capacity(self.triangles.len());
        for triangle in &self.triangles {
            sums.push(sums.last().copied().unwrap_or(0.0) + self.area(triangle));
        }
        let Some(&whole) = sums.last().filter(|sum| **sum > 0.0 && sum.is_finite()) else {
            return Err(Error::input("a mesh without surface (allowed: one or more triangles with an area)"));
        };
        let mut draws = stream(seed, 0);
        let point = |_| {
            let place = draws.uniform() * whole;
            let triangle = sums.partition_point(|&sum| sum <= place).min(self.triangles.len() - 1);
            let [a, b, c] = self.triangles[triangle].map(|vertex| self.vertices[vertex as usize]);
            let (root, share) = (draws.uniform().sqrt(), draws.uniform());
            std::array::from_fn(|i| (1.0 - root) * a[i] + root * ((1.0 - share) * b[i] + share * c[i]))
        };
        Ok((0..count).map(point).collect())
    }

    fn area(&self, triangle: &[u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|vertex| self.vertices[vertex as usize]);
        let (u, v) = (minus(b, a), minus(c, a));
        let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        0.5 * normal.iter().map(|n| n * n).sum::<f64>().sqrt()
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Reads an OFF file; faces of more than three corners are divided into triangles around their first one. What stands after
/// the coordinates of a vertex, or after the corners of a face, is ignored, so that files with texture coordinates (`STOFF`),
/// colours (`COFF`) or normals (`NOFF`) are read; those whose vertices have other than three coordinates (`4OFF`, `nOFF`) are
/// not. Files whose counts stand on the line of the word `OFF`, as in some of ModelNet, are read too.
///
/// # Errors
/// [`Error::Malformed`] with the line.
pub fn read_off(path: &Path) -> Result<Mesh> {
    let text = open::text(path, MOST)?;
    let mut lines = Lines { path, lines: text.lines().enumerate(), number: 0 };
    let first = lines.next("the word OFF")?;
    let rest = lines.after_off(first)?;
    let counts = if rest.is_empty() { lines.next("counts")? } else { rest };
    let [vertices, faces] = lines.numbers::<usize, 2>("counts", counts)?;
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    for _ in 0..vertices {
        let line = lines.next("a vertex")?;
        let vertex = lines.numbers::<f64, 3>("a vertex", line)?;
        match vertex.iter().all(|c| c.is_finite()) {
            true => mesh.vertices.push(vertex),
            false => return Err(lines.malformed("a vertex", line, "finite coordinates")),
        }
    }
    for _ in 0..faces {
        let line = lines.next("a face")?;
        lines.face(line, &mut mesh)?;
    }
    Ok(mesh)
}

/// The lines that hold something.
struct Lines<'a> {
    path: &'a Path,
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    /// Number of the last line that was read.
    number: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self, field: &str) -> Result<&'a str> {
        for (number, line) in self.lines.by_ref() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if !line.is_empty() {
                self.number = number + 1;
                return Ok(line);
            }
        }
        Err(self.malformed(field, "end of file", "one line more"))
    }

    /// What stands after the word `OFF` on the first line.
    fn after_off(&self, line: &'a str) -> Result<&'a str> {
        let allowed = "OFF, also with ST, C, N before it (texture coordinates, colours, normals)";
        let Some((before, after)) = line.split_once("OFF") else {
            return Err(self.malformed("the word OFF", line, allowed));
        };
        let mut kind = before;
        for extra in ["ST", "C", "N"] {
            kind = kind.strip_prefix(extra).unwrap_or(kind);
        }
        match kind {
            "" => Ok(after.trim()),
            "4" | "n" | "4n" => {
                let found = format!("{before}OFF, whose vertices have other than 3 coordinates");
                Err(self.malformed("the word OFF", found, allowed))
            }
            _ => Err(self.malformed("the word OFF", line, allowed)),
        }
    }

    /// The first `N` numbers of a line.
    fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(
        &self,
        field: &str,
        line: &str,
    ) -> Result<[T; N]> {
        let mut found = [T::default(); N];
        let mut words = line.split_whitespace();
        for slot in &mut found {
            *slot = words
                .next()
                .and_then(|word| word.parse().ok())
                .ok_or_else(|| self.malformed(field, line, format!("{N} numbers")))?;
        }
        Ok(found)
    }

    fn face(&self, line: &str, mesh: &mut Mesh) -> Result<()> {
        let [corners] = self.numbers::<usize, 1>("a face", line)?;
        let expected = || format!("the number of corners, then as many vertices below {}", mesh.vertices.len());
        let all: Option<Vec<u32>> =
            line.split_whitespace().skip(1).take(corners).map(|word| word.parse().ok()).collect();
        let all = all.filter(|all| all.len() == corners && all.iter().all(|&v| (v as usize) < mesh.vertices.len()));
        let all = all.ok_or_else(|| self.malformed("a face", line, expected()))?;
        let (Some(&first), others) = (all.first(), all.get(1..).unwrap_or_default()) else { return Ok(()) };
        mesh.triangles.extend(others.windows(2).map(|pair| [first, pair[0], pair[1]]));
        Ok(())
    }

    fn malformed(&self, field: &str, found: impl ToString, allowed: impl ToString) -> Error {
        Error::Malformed {
            path: self.path.to_path_buf(),
            format: "OFF",
            field: field.into(),
            place: format!("line {}", self.number),
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "OFF\n# a square of 2 x 1 and a triangle that is a line\n4 2 0\n0 0 0\n2 0 0 255 0 0\n2 1 0\n\n0 1 0\n\
                          4 0 1 2 3 0.5 0.5 0.5\n3 0 1 1\n";

    fn read(text: &str) -> Result<Mesh> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("square.off");
        std::fs::write(&path, text).unwrap();
        read_off(&path)
    }

    #[test]
    fn faces_become_triangles_with_and_without_the_counts_on_the_first_line() {
        let mesh = read(SQUARE).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 1]]);
        assert_eq!(
            read(&SQUARE.replace("OFF\n# a square of 2 x 1 and a triangle that is a line\n", "OFF")).unwrap(),
            mesh
        );
    }

    #[test]
    fn points_lie_evenly_on_the_surface() {
        let mesh = read(SQUARE).unwrap();
        let points = mesh.sampled(40_000, 7).unwrap();
        assert!(points.iter().all(|p| (0.0..=2.0).contains(&p[0]) && (0.0..=1.0).contains(&p[1]) && p[2] == 0.0));
        // 8 x 4 fields with the same number of points, up to chance.
        let mut counts = [0; 32];
        points.iter().for_each(|p| counts[(p[0] * 4.0).min(7.0) as usize * 4 + (p[1] * 4.0).min(3.0) as usize] += 1);
        assert!(counts.iter().all(|count| (1050..1450).contains(count)), "{counts:?}");
        assert_eq!(mesh.sampled(40_000, 7).unwrap(), points);
        assert!(Mesh { triangles: vec![[0, 1, 1]], ..mesh.clone() }.sampled(1, 0).is_err());
        let beyond = Mesh { triangles: vec![[0, 1, 4]], ..mesh }.sampled(1, 0).unwrap_err().to_string();
        assert!(beyond.contains("vertex 4 (allowed: below 4)"), "{beyond}");
    }

    #[test]
    fn files_with_more_than_coordinates_are_read_and_those_of_other_dimensions_refused_by_name() {
        let mesh = read(SQUARE).unwrap();
        for name in ["COFF", "NOFF", "STOFF", "STCNOFF"] {
            assert_eq!(read(&SQUARE.replacen("OFF", name, 1)).unwrap(), mesh, "{name}");
        }
        for name in ["4OFF", "nOFF", "C4OFF", "4nOFF"] {
            let message = read(&SQUARE.replacen("OFF", name, 1)).unwrap_err().to_string();
            assert!(message.contains(&format!("{name}, whose vertices have other than 3")), "{message}");
        }
        assert!(read(&SQUARE.replacen("OFF", "XOFF", 1)).unwrap_err().to_string().contains("XOFF"));
        assert!(read(&SQUARE.replacen("OFF", "OFF BINARY", 1)).is_err());
    }

    #[test]
    fn a_file_cut_at_any_byte_is_an_error_or_the_whole_mesh() {
        let mesh = read(SQUARE).unwrap();
        let cuts = (0..SQUARE.len()).filter(|&cut| read(&SQUARE[..cut]).is_ok_and(|found| found == mesh));
        assert_eq!(cuts.collect::<Vec<_>>(), [SQUARE.len() - 1]);
        assert!((0..SQUARE.len() - 1).all(|cut| matches!(read(&SQUARE[..cut]), Err(Error::Malformed { .. }))));
    }

    #[test]
    fn damaged_files_are_refused_with_the_line() {
        let message = |text: &str| read(text).unwrap_err().to_string();
        assert!(message("PLY\n").contains("line 1"));
        assert!(message("").contains("end of file"));
        assert!(message(&SQUARE.replace("2 1 0", "2 x 0")).contains("line 6"));
        assert!(message(&SQUARE.replace("2 1 0", "2 inf 0")).contains("finite"));
        assert!(message(&SQUARE.replace("3 0 1 1", "3 0 1 4")).contains("below 4"));
        assert!(message(&SQUARE.replace("3 0 1 1", "9 0 1 1")).contains("corners"));
        assert!(message(&SQUARE.replace("4 2 0\n", "4000000000000 2 0\n")).contains("a vertex"));
    }
}
