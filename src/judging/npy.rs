//! The records of a rollout as a file that NumPy reads: `numpy.load(path)["p_m"]`.
//!
//! Format 1.0 of <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>: an array of one
//! record a tick, its fields one behind the other. docs/own-judge.md has the fields as a table.

use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;

use shm_types::episode::{
    FLAG_IN_CONTACT, FLAG_NEAR_JOINT_LIMIT, FLAG_NEAR_SPEED_LIMIT, FLAG_RATE_LIMITED,
    FLAG_TORQUE_CLIPPED, TickRecord,
};

const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";
/// The data begin at a multiple of so many bytes.
const ALIGNMENT: usize = 64;

/// One of a record.
struct Field {
    name: &'static str,
    /// As NumPy names it.
    kind: &'static str,
    /// Its numbers; a single one has no dimension.
    len: usize,
    put: fn(&TickRecord, &mut Vec<u8>),
}

const F8: &str = "<f8";
const U4: &str = "<u4";
const TRUTH: &str = "|b1";

const FIELDS: &[Field] = &[
    Field { name: "t_s", kind: F8, len: 1, put: |r, to| floats(to, &[r.t_s]) },
    Field { name: "q_rad", kind: F8, len: 7, put: |r, to| floats(to, &r.q) },
    Field { name: "qd_rad_s", kind: F8, len: 7, put: |r, to| floats(to, &r.qd) },
    Field { name: "tau_nm", kind: F8, len: 7, put: |r, to| floats(to, &r.tau) },
    Field { name: "p_m", kind: F8, len: 3, put: |r, to| floats(to, &r.x[..3]) },
    Field { name: "v_m_s", kind: F8, len: 3, put: |r, to| floats(to, &r.xd[..3]) },
    Field { name: "rotation_rad", kind: F8, len: 3, put: |r, to| floats(to, &turn(&r.x)) },
    Field { name: "spin_rad_s", kind: F8, len: 3, put: |r, to| floats(to, &turn(&r.xd)) },
    Field { name: "attractor_m", kind: F8, len: 3, put: |r, to| floats(to, &r.attractor[..3]) },
    Field { name: "attractor_rad", kind: F8, len: 3, put: |r, to| floats(to, &turn(&r.attractor)) },
    Field { name: "object_m", kind: F8, len: 3, put: |r, to| floats(to, &r.object_position) },
    Field { name: "object_wxyz", kind: F8, len: 4, put: |r, to| floats(to, &r.object_quaternion) },
    Field { name: "in_contact", kind: TRUTH, len: 1, put: |r, to| flag(to, r, FLAG_IN_CONTACT) },
    Field { name: "clipped", kind: TRUTH, len: 1, put: |r, to| flag(to, r, FLAG_TORQUE_CLIPPED) },
    Field {
        name: "rate_limited",
        kind: TRUTH,
        len: 1,
        put: |r, to| flag(to, r, FLAG_RATE_LIMITED),
    },
    Field {
        name: "near_joint_limit",
        kind: TRUTH,
        len: 1,
        put: |r, to| flag(to, r, FLAG_NEAR_JOINT_LIMIT),
    },
    Field {
        name: "near_speed_limit",
        kind: TRUTH,
        len: 1,
        put: |r, to| flag(to, r, FLAG_NEAR_SPEED_LIMIT),
    },
    Field { name: "phase", kind: U4, len: 1, put: |r, to| to.extend(r.phase.to_le_bytes()) },
    Field { name: "fault", kind: U4, len: 1, put: |r, to| to.extend(r.fault.to_le_bytes()) },
];

fn floats(to: &mut Vec<u8>, values: &[f64]) {
    values.iter().for_each(|value| to.extend_from_slice(&value.to_le_bytes()));
}

fn flag(to: &mut Vec<u8>, record: &TickRecord, bit: u32) {
    to.push(u8::from(record.flags & bit != 0));
}

/// The rotational part, which a record keeps as pitch, roll, yaw, in the order x, y, z.
fn turn(task: &[f64; 6]) -> [f64; 3] {
    [task[4], task[3], task[5]]
}

/// Writes `records` over the file at `path`, in one go.
pub fn write(path: &Path, records: &[TickRecord]) -> io::Result<()> {
    let bytes = encode(records);
    // Not shortened first: the blocks that are there are used again.
    let file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
    file.write_all_at(&bytes, 0)?;
    file.set_len(bytes.len() as u64)
}

fn encode(records: &[TickRecord]) -> Vec<u8> {
    let mut bytes = header(records.len());
    bytes.reserve(records.len() * record_bytes());
    for record in records {
        FIELDS.iter().for_each(|field| (field.put)(record, &mut bytes));
    }
    bytes
}

fn record_bytes() -> usize {
    let size = |field: &Field| match field.kind {
        F8 => 8 * field.len,
        U4 => 4 * field.len,
        _ => field.len,
    };
    FIELDS.iter().map(size).sum()
}

fn header(n_records: usize) -> Vec<u8> {
    let field = |field: &Field| match field.len {
        1 => format!("('{}', '{}'), ", field.name, field.kind),
        n => format!("('{}', '{}', ({n},)), ", field.name, field.kind),
    };
    let fields: String = FIELDS.iter().map(field).collect();
    let mut text =
        format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': ({n_records},), }}");
    let before = MAGIC.len() + size_of::<u16>();
    let end = (before + text.len() + 1).next_multiple_of(ALIGNMENT);
    text += &" ".repeat(end - before - text.len() - 1);
    text.push('\n');
    let len = u16::try_from(text.len()).expect("a header of some hundred bytes");
    [MAGIC, &len.to_le_bytes(), text.as_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::{MAX_JOINTS, TASK_DIM};

    fn record(k: usize) -> TickRecord {
        let number = |c: usize| (100 * k + c) as f64;
        TickRecord {
            phase: 2,
            fault: k as u32,
            t_s: 0.001 * k as f64,
            q: std::array::from_fn(number),
            x: std::array::from_fn(|c| -number(c)),
            object_position: [0.1, 0.2, number(0)],
            flags: FLAG_IN_CONTACT | FLAG_NEAR_SPEED_LIMIT,
            ..TickRecord::ZERO
        }
    }

    /// Where the field `name` stands in the record `k`.
    fn at(bytes: &[u8], name: &str, k: usize) -> usize {
        let start = bytes.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        let before = FIELDS.iter().take_while(|field| field.name != name);
        let mut offset = Vec::new();
        before.for_each(|field| (field.put)(&TickRecord::ZERO, &mut offset));
        start + k * record_bytes() + offset.len()
    }

    #[test]
    fn the_header_is_one_of_format_1_0() {
        let bytes = encode(&[]);
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        assert_eq!(usize::from(u16::from_le_bytes([bytes[8], bytes[9]])), bytes.len() - 10);
        assert!(bytes.len().is_multiple_of(64) && bytes.ends_with(b" \n"));
        let text = String::from_utf8(bytes[10..].to_vec()).unwrap();
        assert!(text.starts_with("{'descr': [('t_s', '<f8'), ('q_rad', '<f8', (7,)), "), "{text}");
        assert!(text.trim_end().ends_with("'shape': (0,), }"), "{text}");
    }

    #[test]
    fn every_number_stands_in_its_place() {
        let bytes = encode(&[record(0), record(1), record(2)]);
        let f8 = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        assert_eq!(bytes.len(), at(&bytes, "t_s", 3), "as long as its records");
        assert_eq!(f8(at(&bytes, "t_s", 2)), 0.002);
        assert_eq!(f8(at(&bytes, "q_rad", 1) + 8 * 6), 106.0);
        assert_eq!(f8(at(&bytes, "p_m", 2) + 8), -201.0);
        // Pitch is a turn around y.
        let rotation = at(&bytes, "rotation_rad", 1);
        assert_eq!([0, 8, 16].map(|i| f8(rotation + i)), [-104.0, -103.0, -105.0]);
        assert_eq!(f8(at(&bytes, "object_m", 1) + 16), 100.0);
        let truth = |name: &str| bytes[at(&bytes, name, 1)];
        assert_eq!((truth("in_contact"), truth("clipped"), truth("near_speed_limit")), (1, 0, 1));
        assert_eq!((bytes[at(&bytes, "phase", 1)], bytes[at(&bytes, "fault", 2)]), (2, 2));
        let sizes = [F8, U4, TRUTH].map(|kind| FIELDS.iter().filter(|f| f.kind == kind).count());
        assert_eq!((sizes, MAX_JOINTS, TASK_DIM), ([12, 2, 5], 7, 6));
    }

    #[test]
    fn a_shorter_rollout_leaves_nothing_of_a_longer_one() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("rollout.npy");
        for records in [&[record(0), record(1)][..], &[record(3)]] {
            write(&path, records).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), encode(records));
        }
    }

    /// As the documents say it.
    #[test]
    fn the_documents_name_every_field() {
        let text = include_str!("../../docs/own-judge.md");
        for Field { name, len, .. } in FIELDS {
            let row = text
                .lines()
                .find(|line| line.starts_with('|') && line.contains(&format!("`{name}`")));
            let row = row.unwrap_or_else(|| panic!("no row has {name}"));
            assert!(*len == 1 || row.contains(&len.to_string()), "{row}");
        }
    }
}
