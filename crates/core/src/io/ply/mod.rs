//! PLY: ascii and binary of both byte orders; properties of any type in any order; lists and other elements are
//! skipped.

mod header;
mod read;
mod write;

pub(super) use read::{Reader, inspect, read};
pub(super) use write::write;

#[cfg(test)]
mod tests {
    use crate::cloud::{Cloud, Column, Values};
    use crate::error::Result;
    use crate::io;

    fn read_bytes(bytes: &[u8]) -> Result<Cloud> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        std::fs::write(&path, bytes).unwrap();
        io::read(&path)
    }

    #[test]
    fn ascii_and_both_binary_orders_give_the_same_cloud() {
        let head = |f: &str| {
            format!(
                "ply\r\nformat {f} 1.0\r\ncomment c\r\nelement vertex 2\r\nproperty list uchar int n\r\nproperty float x\r\nproperty double y\r\nproperty short z\r\nproperty uchar red\r\nproperty int scalar_Classification\r\nelement face 1\r\nproperty list uchar int v\r\nend_header\r\n"
            )
        };
        let ascii =
            read_bytes((head("ascii") + "2 7 8 1.5 2.25 -3 200 6\r\n0 4 5 6 1 2\r\n3 0 1 1\r\n").as_bytes()).unwrap();
        let body = |big: bool| {
            let mut b = Vec::new();
            let put = |b: &mut Vec<u8>, le: &[u8]| if big { b.extend(le.iter().rev()) } else { b.extend(le) };
            for (list, x, y, z, red, class) in
                [(&[7i32, 8][..], 1.5f32, 2.25f64, -3i16, 200u8, 6i32), (&[], 4.0, 5.0, 6, 1, 2)]
            {
                b.push(list.len() as u8);
                list.iter().for_each(|v| put(&mut b, &v.to_le_bytes()));
                put(&mut b, &x.to_le_bytes());
                put(&mut b, &y.to_le_bytes());
                put(&mut b, &z.to_le_bytes());
                b.push(red);
                put(&mut b, &class.to_le_bytes());
            }
            b
        };
        let little = read_bytes(&[head("binary_little_endian").as_bytes(), &body(false)].concat()).unwrap();
        let big = read_bytes(&[head("binary_big_endian").as_bytes(), &body(true)].concat()).unwrap();
        assert_eq!(ascii, little);
        assert_eq!(ascii, big);
        assert_eq!(ascii.xyz(0), [1.5, 2.25, -3.0]);
        assert_eq!(ascii.column("Classification").unwrap().values, Values::I32(vec![6, 2]));
    }

    #[test]
    fn malformed_files_are_errors_that_name_the_place() {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        let cases = [
            (head.replace("vertex 2", "vertex 99999999999999"), "number of vertices"),
            (head.to_string() + "1 2 3\n", "at most 1"),
            (head.to_string() + "1.5 2.5 3.5\n1 2\n", "line 9"),
            (head.to_string() + "1.5 2.5 3.5\n1 2 q\n", "line 9"),
            (head.replace("property float z\n", ""), "no `z`"),
            (head.replace("float z\n", "float z\nproperty float x\n"), "twice"),
            ("ply\nformat ascii 1.0\n".into(), "end_header"),
        ];
        for (text, expected) in cases {
            let message = read_bytes(text.as_bytes()).map(|_| ()).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}\nfor\n{text}");
        }
        let negative = [b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty list char int v\nproperty float x\nproperty float y\nproperty float z\nend_header\n".as_slice(), &[0xff; 40]].concat();
        assert!(read_bytes(&negative).unwrap_err().to_string().contains("list length"));
    }

    #[test]
    fn what_is_written_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let mut cloud = Cloud::from_rows(&[[652_000.123, 6e6, 1.0], [652_001.0, 6e6 + 0.5, f64::NAN]]).unwrap();
        cloud.set_column(Column::new("Red", Values::U8(vec![1, 255]))).unwrap();
        cloud.set_column(Column::new("Confidence", Values::F32(vec![0.5, 0.25]))).unwrap();
        io::write(&path, &cloud, &Default::default()).unwrap();
        let back = io::read(&path).unwrap();
        assert_eq!(back.columns(), cloud.columns());
        assert_eq!(back.xyz(0), cloud.xyz(0));
        assert!(back.xyz(1)[2].is_nan());
        io::write(&path, &Cloud::from_rows(&[]).unwrap(), &Default::default()).unwrap();
        assert!(io::read(&path).unwrap().is_empty());
    }

    #[test]
    fn lists_among_the_numbers_of_binary_vertices_are_passed_over() {
        let head = "ply\nformat binary_little_endian 1.0\nelement edge 1\nproperty list uchar int v\nelement vertex 2\nproperty float x\nproperty list ushort char n\nproperty float y\nproperty float z\nproperty uchar red\nend_header\n";
        let mut bytes = head.as_bytes().to_vec();
        bytes.extend([2, 9, 9, 9, 9, 9, 9, 9, 9]);
        for (x, items) in [(1.0f32, 3u16), (4.0, 0)] {
            bytes.extend(x.to_le_bytes());
            bytes.extend(items.to_le_bytes());
            bytes.extend(vec![7; usize::from(items)]);
            bytes.extend((x + 1.0).to_le_bytes());
            bytes.extend((x + 2.0).to_le_bytes());
            bytes.push(200);
        }
        let cloud = read_bytes(&bytes).unwrap();
        assert_eq!((cloud.xyz(0), cloud.xyz(1)), ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
        assert_eq!(cloud.column("Red").unwrap().values, Values::U8(vec![200, 200]));
        assert!(read_bytes(&bytes[..bytes.len() - 1]).is_err());
    }

    #[test]
    fn the_header_alone_tells_points_and_columns() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nend_header\n1 2 3 q\n").unwrap();
        let info = io::inspect(&path).unwrap();
        assert_eq!((info.points, &info.dimensions[..]), (1, &["Red".to_string()][..]));
        assert!(io::read(&path).unwrap_err().to_string().contains("line 9:7"));
    }
}
