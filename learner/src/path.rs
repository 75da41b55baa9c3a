//! The decimated path of a rollout: every 10th tick record, for figures and for the session file.

use imitation::sphere::nearest_equivalent;
use nalgebra::Vector3;
use shm_types::episode::TickRecord;
use thiserror::Error;

/// Records per kept row.
pub const DECIMATION: usize = 10;
/// Numbers per row.
pub const COLUMNS: usize = 20;
const ROW_BYTES: usize = COLUMNS * size_of::<f32>();

/// One row; single precision is plenty for figures and halves the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRow {
    /// Time since the start of Execute, s (0 before).
    pub t_s: f32,
    /// Pan, world frame: m, and rotation vector as pitch, roll, yaw in rad.
    pub pan_position: [f32; 3],
    pub pan_rotation: [f32; 3],
    /// Object, world frame: m, and unit quaternion w, i, j, k.
    pub object_position: [f32; 3],
    pub object_quaternion: [f32; 4],
    /// Σ hᵢ μᵢ: x, y, z in m, pitch, roll, yaw in rad.
    pub attractor: [f32; 6],
}

#[derive(Debug, Error, PartialEq)]
#[error("path has {bytes} bytes, not a multiple of {ROW_BYTES}")]
pub struct PathError {
    pub bytes: usize,
}

impl PathRow {
    fn from_record(record: &TickRecord) -> Self {
        // What single precision cannot hold is the largest it can: still a number, like its source.
        let single = |value: f64| value.clamp(f32::MIN.into(), f32::MAX.into()) as f32;
        PathRow {
            t_s: single(record.t_s),
            pan_position: std::array::from_fn(|c| single(record.x[c])),
            pan_rotation: std::array::from_fn(|c| single(record.x[c + 3])),
            object_position: record.object_position.map(single),
            object_quaternion: record.object_quaternion.map(single),
            attractor: record.attractor.map(single),
        }
    }

    /// The row in column order: t, pan position 3, pan rotation 3, object position 3, object
    /// quaternion 4, attractor 6.
    pub fn columns(&self) -> [f32; COLUMNS] {
        let mut columns = [0.0; COLUMNS];
        columns[0] = self.t_s;
        columns[1..4].copy_from_slice(&self.pan_position);
        columns[4..7].copy_from_slice(&self.pan_rotation);
        columns[7..10].copy_from_slice(&self.object_position);
        columns[10..14].copy_from_slice(&self.object_quaternion);
        columns[14..].copy_from_slice(&self.attractor);
        columns
    }

    fn from_columns(columns: [f32; COLUMNS]) -> Self {
        PathRow {
            t_s: columns[0],
            pan_position: std::array::from_fn(|c| columns[1 + c]),
            pan_rotation: std::array::from_fn(|c| columns[4 + c]),
            object_position: std::array::from_fn(|c| columns[7 + c]),
            object_quaternion: std::array::from_fn(|c| columns[10 + c]),
            attractor: std::array::from_fn(|c| columns[14 + c]),
        }
    }
}

/// Every 10th record, from the first.
pub fn decimate(records: &[TickRecord]) -> Vec<PathRow> {
    records.iter().step_by(DECIMATION).map(PathRow::from_record).collect()
}

/// The rows with rotation vectors that go on beyond half a turn, each the one nearest to that before: a movement on
/// the sphere as figures show it.
pub fn unwrapped(mut rows: Vec<PathRow>) -> Vec<PathRow> {
    let mut before: Option<Vector3<f64>> = None;
    for row in &mut rows {
        let vector = Vector3::from(row.pan_rotation.map(f64::from));
        let nearest = before.map_or(vector, |before| nearest_equivalent(&vector, &before));
        row.pan_rotation = [nearest.x as f32, nearest.y as f32, nearest.z as f32];
        before = Some(nearest);
    }
    rows
}

/// Rows as a table of little-endian f32.
pub fn encode(rows: &[PathRow]) -> Vec<u8> {
    rows.iter().flat_map(PathRow::columns).flat_map(f32::to_le_bytes).collect()
}

/// Inverse of [`encode`].
pub fn decode(bytes: &[u8]) -> Result<Vec<PathRow>, PathError> {
    if !bytes.len().is_multiple_of(ROW_BYTES) {
        return Err(PathError { bytes: bytes.len() });
    }
    let number = |row: &[u8], c: usize| {
        let at = c * size_of::<f32>();
        f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]])
    };
    let row = |row: &[u8]| PathRow::from_columns(std::array::from_fn(|c| number(row, c)));
    Ok(bytes.chunks_exact(ROW_BYTES).map(row).collect())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    #[test]
    fn a_number_stays_a_number() {
        let mut record = TickRecord { t_s: 1e300, ..TickRecord::ZERO };
        record.object_position[2] = -f64::MAX;
        let columns = decimate(&[record])[0].columns();
        assert_eq!((columns[0], columns[9]), (f32::MAX, f32::MIN));
    }

    #[test]
    fn a_full_turn_goes_on_beyond_half_a_turn() {
        let records: Vec<TickRecord> = (0..=630)
            .map(|k| {
                let mut record = TickRecord::ZERO;
                let angle = 0.01 * f64::from(k);
                record.x[3] = if angle > PI { angle - TAU } else { angle };
                record
            })
            .collect();
        let rows = unwrapped(decimate(&records));
        let last = rows[63].pan_rotation;
        assert!((last[0] - 6.3).abs() < 1e-5 && last[1..] == [0.0, 0.0], "{last:?}");
        let steps = rows.windows(2).map(|pair| pair[1].pan_rotation[0] - pair[0].pan_rotation[0]);
        assert!(steps.into_iter().all(|step| (step - 0.1).abs() < 1e-5));
    }

    #[test]
    fn keeps_every_tenth_record_and_survives_a_round_trip() {
        let records: Vec<TickRecord> = (0..25)
            .map(|k| {
                let mut record = TickRecord { t_s: k as f64 * 1e-3, ..TickRecord::ZERO };
                record.x = std::array::from_fn(|c| (k * 10 + c) as f64);
                record.attractor = record.x.map(|x| -x);
                record.object_position = [1.0, 2.0, k as f64];
                record
            })
            .collect();
        let rows = decimate(&records);
        assert_eq!(rows.len(), 3);
        assert_eq!(rows[2].pan_position, [200.0, 201.0, 202.0]);
        assert_eq!(rows[2].pan_rotation, [203.0, 204.0, 205.0]);
        assert_eq!(rows[1].columns()[9], 10.0);
        let bytes = encode(&rows);
        assert_eq!(bytes.len(), 3 * 80);
        assert_eq!(decode(&bytes), Ok(rows));
        assert_eq!(decode(&bytes[1..]), Err(PathError { bytes: 239 }));
    }
}
