//! Files that are no text, by their first bytes, and how to make CSV of each.

use anyhow::{Result, bail};

/// First bytes, what the file is, and how to convert it.
type Format = (&'static [u8], &'static str, &'static str);

const NUMPY: &str = "convert it in Python: numpy.savetxt(\"recording.csv\", array, delimiter=\",\", \
                     header=\"t_s,q1_rad,…\", comments=\"\")";
const PANDAS: &str = "in Python: pandas.read_parquet(…).to_csv(\"recording.csv\", index=False)";
const ROSBAG: &str = "convert it: `rostopic echo -b FILE -p /joint_states > recording.csv`, or export CSV \
                      from PlotJuggler";
const PLOTJUGGLER: &str = "open it in PlotJuggler and export CSV";
const SPREADSHEET: &str = "save the sheet as CSV (File, Save as)";
const PICKLE: &str = "write CSV where it was pickled, e.g. pandas.DataFrame(…).to_csv(\"recording.csv\", \
                      index=False)";
const HDF5: &str = "convert it in Python: h5py.File(…), then numpy.savetxt(\"recording.csv\", …, \
                    delimiter=\",\")";
const MATLAB: &str = "in MATLAB: writematrix or writetable; in Python: scipy.io.loadmat, then \
                      numpy.savetxt";
const JSON: &str =
    "convert it in Python: pandas.read_json(…).to_csv(\"recording.csv\", index=False)";

const FORMATS: [Format; 23] = [
    (b"\x93NUMPY", "a NumPy array (.npy)", NUMPY),
    (b"PAR1", "a Parquet file", PANDAS),
    (b"\x89MCAP", "an MCAP recording", PLOTJUGGLER),
    (b"#ROSBAG", "a ROS bag", ROSBAG),
    (
        b"SQLite format 3",
        "an SQLite database (a ROS 2 bag, or a session of this tool)",
        PLOTJUGGLER,
    ),
    (b"\x1f\x8b", "compressed with gzip", "unpack it with gunzip"),
    (b"\x28\xb5\x2f\xfd", "compressed with Zstandard", "unpack it with `zstd -d`"),
    (b"\xfd7zXZ", "compressed with xz", "unpack it with `xz -d`"),
    (b"BZh", "compressed with bzip2", "unpack it with `bzip2 -d`"),
    (b"\x04\x22\x4d\x18", "compressed with LZ4", "unpack it with `lz4 -d`"),
    (b"7z\xbc\xaf", "a 7-Zip archive", "unpack it"),
    (b"\x89HDF", "an HDF5 file (LeRobot, robomimic, MATLAB 7.3)", HDF5),
    (b"MATLAB 5.0", "a MATLAB file", MATLAB),
    (b"ARROW1", "an Arrow file", "in Python: pandas.read_feather(…).to_csv(\"recording.csv\")"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook (.xls)", SPREADSHEET),
    (b"\x80\x02", "a Python pickle", PICKLE),
    (b"\x80\x03", "a Python pickle", PICKLE),
    (b"\x80\x04", "a Python pickle", PICKLE),
    (b"\x80\x05", "a Python pickle", PICKLE),
    (b"TDSm", "a LabVIEW TDMS file", "export it as text"),
    (b"ULog", "a PX4 log", PLOTJUGGLER),
    (b"%PDF", "a PDF document", "export the table as CSV"),
    (b"\x7fELF", "a program", "give the recording"),
];

/// Refuses what is no table of text: named, with the way to a table.
pub fn refuse(file: &str, bytes: &[u8]) -> Result<()> {
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        let (what, how) = zip(bytes);
        bail!("{file}: this is {what}, not CSV: {how}");
    }
    for (magic, what, how) in FORMATS {
        if bytes.starts_with(magic) {
            bail!("{file}: this is {what}, not CSV: {how}");
        }
    }
    if bytes.len() > 262 && &bytes[257..262] == b"ustar" {
        bail!("{file}: this is a tar archive, not CSV: unpack it");
    }
    let start = bytes.trim_ascii_start();
    let begins =
        |words: &[u8]| start.get(..words.len()).is_some_and(|s| s.eq_ignore_ascii_case(words));
    if begins(b"<!doctype") || begins(b"<html") || begins(b"<?xml") || begins(b"<robot") {
        bail!("{file}: this is HTML or XML, not CSV: give the recording itself");
    }
    let second = start.get(1..).map_or(&[][..], <[u8]>::trim_ascii_start);
    if begins(b"{") || (begins(b"[") && matches!(second.first(), Some(b'{' | b'['))) {
        bail!("{file}: this is JSON, not CSV: {JSON}");
    }
    Ok(())
}

/// Many formats are a zip archive of something; the names inside tell.
fn zip(bytes: &[u8]) -> (&'static str, &'static str) {
    let head = &bytes[..bytes.len().min(4096)];
    let holds = |name: &[u8]| head.windows(name.len()).any(|window| window == name);
    if holds(b".npy") {
        return ("a NumPy archive (.npz)", NUMPY);
    }
    if holds(b"[Content_Types].xml") || holds(b"xl/") {
        return ("an Excel workbook (.xlsx)", SPREADSHEET);
    }
    if holds(b"opendocument.spreadsheet") {
        return ("an OpenDocument sheet (.ods)", SPREADSHEET);
    }
    if holds(b"data.pkl") {
        return ("a PyTorch file", PICKLE);
    }
    ("a zip archive", "unpack it and give the recording inside")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_what_is_no_text_and_lets_text_pass() {
        for (bytes, words) in [
            (&b"\x93NUMPY\x01\x00v\x00{'descr': '<f8'"[..], ["NumPy array", "savetxt"]),
            (b"PK\x03\x04\x14\x00\x00\x00\x08\x00q.npy", [".npz", "savetxt"]),
            (b"PK\x03\x04\x14\x00\x06\x00[Content_Types].xml", [".xlsx", "CSV"]),
            (b"PK\x03\x04rec.csv", ["zip archive", "unpack"]),
            (b"PAR1\x15\x04", ["Parquet", "to_csv"]),
            (b"\x89MCAP0\r\n", ["MCAP", "PlotJuggler"]),
            (b"#ROSBAG V2.0\n", ["ROS bag", "rostopic echo"]),
            (b"\x1f\x8b\x08\x00", ["gzip", "gunzip"]),
            (b"\x89HDF\r\n\x1a\n", ["HDF5", "h5py"]),
            (b"\x80\x04\x95", ["pickle", "to_csv"]),
            (b"  {\"t\": [0, 1]}", ["JSON", "read_json"]),
            (b"[[0.0, 1.0],[0.1, 1.0]]", ["JSON", "read_json"]),
            (b"<!DOCTYPE html>", ["HTML", "recording"]),
        ] {
            let message = refuse("r.csv", bytes).unwrap_err().to_string();
            for word in words {
                assert!(
                    message.starts_with("r.csv: this is") && message.contains(word),
                    "{message}"
                );
            }
        }
        for text in ["t_s,x_m\n", "# comment\n", "%time,a\n", "", "[0.1, 2]\n"] {
            refuse("r.csv", text.as_bytes()).unwrap();
        }
    }
}
