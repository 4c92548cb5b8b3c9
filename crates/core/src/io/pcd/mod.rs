//! PCD of the Point Cloud Library: ascii, binary, and `binary_compressed` (LZF, column after column).
//!
//! `rgb` and `rgba` of four bytes become Red, Green, Blue (and Alpha); a field with COUNT n becomes n columns `name_0`,
//! `name_1`, ...; padding (`_`) is skipped. NaN points of organised clouds are kept. The sensor pose in VIEWPOINT is
//! not applied, as in the library itself; `inspect` reports it.

mod header;
mod lzf;
mod read;
mod write;

pub(super) use read::{Reader, inspect, read};
pub(super) use write::write;

#[cfg(test)]
mod tests {
    use super::lzf;
    use crate::cloud::{Cloud, Column, Values};
    use crate::error::Result;
    use crate::io::{self, WriteOptions};

    fn read_bytes(bytes: &[u8]) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pcd");
        std::fs::write(&path, bytes).unwrap();
        io::inspect(&path)?;
        io::read(&path)
    }

    fn head(points: &str, data: &str) -> String {
        format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb _ hist\nSIZE 4 4 8 4 1 2\nTYPE F F F U U I\nCOUNT 1 1 1 1 3 2\n{points}\nDATA {data}\n"
        )
    }

    /// Two points of the header above, record after record.
    fn records() -> Vec<u8> {
        let mut bytes = Vec::new();
        for (x, z, rgb, hist) in [(1.5f32, 3.25f64, 0x0001_02ffu32, -7i16), (f32::NAN, -1.0, 0xff0a_0b0c, 300)] {
            bytes.extend(x.to_le_bytes());
            bytes.extend(2.0f32.to_le_bytes());
            bytes.extend(z.to_le_bytes());
            bytes.extend(rgb.to_le_bytes());
            bytes.extend([9, 9, 9]);
            bytes.extend(hist.to_le_bytes());
            bytes.extend((hist + 1).to_le_bytes());
        }
        bytes
    }

    fn check(cloud: &Cloud) {
        assert_eq!(cloud.xyz(0), [1.5, 2.0, 3.25]);
        assert!(cloud.xyz(1)[0].is_nan());
        let values = |name: &str| cloud.column(name).unwrap().values.clone();
        assert_eq!(values("Red"), Values::U8(vec![1, 10]));
        assert_eq!(values("Green"), Values::U8(vec![2, 11]));
        assert_eq!(values("Blue"), Values::U8(vec![255, 12]));
        assert_eq!(values("hist_0"), Values::I16(vec![-7, 300]));
        assert_eq!(values("hist_1"), Values::I16(vec![-6, 301]));
        assert_eq!(cloud.columns().len(), 5);
    }

    #[test]
    fn all_encodings_give_the_same_cloud() {
        let ascii = "1.5 2 3.25 66303 9 9 9 -7 -6\n\nnan\t2 -1 4278848268 9 9 9 300 301\n";
        check(&read_bytes((head("WIDTH 2\nHEIGHT 1\nPOINTS 2", "ascii") + ascii).as_bytes()).unwrap());
        let binary = [head("POINTS 2", "binary").as_bytes(), &records()].concat();
        check(&read_bytes(&binary).unwrap());
        for padded in [false, true] {
            let sizes = [4, 4, 8, 4, 3, 4];
            let (mut columns, mut at) = (Vec::new(), 0);
            for (f, size) in sizes.into_iter().enumerate() {
                let column = records().chunks_exact(27).flat_map(|r| r[at..at + size].to_vec()).collect::<Vec<u8>>();
                columns.extend(if f == 4 && !padded { Vec::new() } else { column });
                at += size;
            }
            let packed = lzf::pack(&columns);
            let sizes = [packed.len() as u32, columns.len() as u32].map(u32::to_le_bytes).concat();
            let head = head("WIDTH 1\nHEIGHT 2\nPOINTS 2", "binary_compressed");
            check(&read_bytes(&[head.as_bytes(), &sizes, &packed].concat()).unwrap());
        }
    }

    #[test]
    fn packed_colours_of_ascii_files_are_floats_or_integers() {
        let head = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n";
        for word in ["4.2108e+06", "1250238080"] {
            let bits = if word.contains('e') { 4.2108e+06f32.to_bits() } else { 1_250_238_080 };
            let cloud = read_bytes(format!("{head}1 2 3 {word}\n").as_bytes()).unwrap();
            assert_eq!(cloud.column("Red").unwrap().values, Values::U8(vec![(bits >> 16) as u8]));
            assert_eq!(cloud.column("Blue").unwrap().values, Values::U8(vec![bits as u8]));
        }
    }

    #[test]
    fn malformed_files_are_errors_that_name_the_place() {
        let binary = |points: &str| [head(points, "binary").as_bytes(), &records()].concat();
        let packed = |sizes: [u32; 2]| {
            let head = head("POINTS 2", "binary_compressed");
            [head.as_bytes(), &sizes.map(u32::to_le_bytes).concat(), &[0; 9]].concat()
        };
        let text = |points: &str, body: &str| (head(points, "ascii") + body).into_bytes();
        let row = "1 2 3 4 5 6 7 8 9\n";
        for (bytes, expected) in [
            (binary("POINTS 3"), "at most 2"),
            (binary("POINTS 18446744073709551615"), "at most 2"),
            (binary("WIDTH 4294967296\nHEIGHT 4294967296"), "below 2^64"),
            (binary("WIDTH 2\nHEIGHT 2\nPOINTS 2"), "4 as WIDTH times HEIGHT"),
            (binary("POINTS -1"), "line 7 (found -1"),
            (packed([1000, 54]), "compressed size"),
            (packed([9, 54_000]), "uncompressed size"),
            (packed([9, 48]), "LZF"),
            (text("POINTS 2", row), "at most 1"),
            (text("POINTS 2", &format!("{row}1.00000000 2.0000000000 3.000000000\n")), "line 10:"),
            (text("POINTS 1", "1 2 3 4 5 6 7 8.5 9\n"), "line 9:15 (found 8.5"),
            (text("POINTS 1", "1 2 3 4 5 6 7 8 9 10\n"), "line 9:19"),
            (text("POINTS 1", "1 2 3 4 5 6 7 8 q\n"), "found q"),
            (b"FIELDS x y z\nSIZE 4 4\nTYPE F F F\nPOINTS 0\nDATA ascii\n".to_vec(), "SIZE"),
            (b"FIELDS x y z\nSIZE 4 4 3\nTYPE F F F\nPOINTS 0\nDATA ascii\n".to_vec(), "F of 3"),
            (b"FIELDS x y q\nSIZE 4 4 4\nTYPE F F F\nPOINTS 0\nDATA ascii\n".to_vec(), "there is no z"),
            (b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 5000\nPOINTS 0\nDATA ascii\n".to_vec(), "COUNT"),
            (b"VERSION 0.7\nFIELDS x y z\n".to_vec(), "DATA"),
        ] {
            let message = read_bytes(&bytes).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}: {expected}");
        }
    }

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pcd");
        let n = 1000;
        for rows in [vec![[0.5, 2.0, f64::NAN]; n], (0..n).map(|i| [652_000.123, i as f64 * 0.1, 1.0]).collect()] {
            let mut cloud = Cloud::from_rows(&rows).unwrap();
            for name in ["Red", "Green", "Blue"] {
                cloud.set_column(Column::new(name, Values::U8((0..n).map(|i| (i % 251) as u8).collect()))).unwrap();
            }
            cloud.set_column(Column::new("Wide", Values::U64((0..n as u64).map(|i| u64::MAX - i).collect()))).unwrap();
            cloud.set_column(Column::new("Intensity", Values::I16((0..n as i16).map(|i| -i).collect()))).unwrap();
            for compressed in [false, true] {
                io::write(&path, &cloud, &WriteOptions { compressed, ..Default::default() }).unwrap();
                let back = io::read(&path).unwrap();
                assert_eq!(back.columns(), cloud.columns());
                assert!((0..n).all(|i| back.xyz(i).map(f64::to_bits) == cloud.xyz(i).map(f64::to_bits)));
            }
        }
        io::write(&path, &Cloud::from_rows(&[]).unwrap(), &WriteOptions::default()).unwrap();
        assert!(io::read(&path).unwrap().is_empty());
    }
}
