//! Cells of a session: what each drives, from which trial on, and to which a rollout was given.

use rusqlite::{Transaction, params};
use shm_types::equipment::{DIGEST_SHOWN, Equipment};

use super::{Store, StoreError};

/// A row of `cells`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellRecord {
    /// As the session calls it; empty where there is but one.
    pub cell: String,
    /// The first trial, in the order in which they were told, that was executed so.
    pub since: u64,
    /// Name of the robot in its URDF, and SHA-256 of that file in hexadecimal; empty without an arm.
    pub arm: String,
    pub urdf_sha256: String,
    pub plant: String,
}

impl CellRecord {
    /// What `cell` told of itself with the trial told as number `since`; `None` if it told nothing.
    pub fn of(cell: &str, since: u64, equipment: &Equipment) -> Option<CellRecord> {
        let told = CellRecord {
            cell: cell.into(),
            since,
            arm: equipment.arm_name(),
            urdf_sha256: equipment.urdf_text(),
            plant: equipment.plant_name(),
        };
        (*equipment != Equipment::UNKNOWN).then_some(told)
    }

    /// Arm and plant are the same, whatever the cell and the trial.
    pub fn is_alike(&self, other: &CellRecord) -> bool {
        (&self.arm, &self.urdf_sha256, &self.plant)
            == (&other.arm, &other.urdf_sha256, &other.plant)
    }

    /// For people: arm, the beginning of its digest, and plant.
    pub fn describe(&self) -> String {
        match self.urdf_sha256.get(..DIGEST_SHOWN) {
            Some(digest) => format!("arm {} (URDF {digest}), plant {}", self.arm, self.plant),
            None => format!("plant {}", self.plant),
        }
    }
}

/// What `cell` drove when the trial in place `told` was executed; `cells` are in the order of their trials.
pub fn equipment_of<'a>(cells: &'a [CellRecord], cell: &str, told: u64) -> Option<&'a CellRecord> {
    cells.iter().rev().find(|row| row.cell == cell && row.since <= told)
}

impl Store {
    /// What the cells drive, in the order of the trials from which on they do.
    pub fn cells(&self) -> Result<Vec<CellRecord>, StoreError> {
        let query = "SELECT cell, since, arm, urdf_sha256, plant FROM cells ORDER BY since, cell";
        let mut statement = self.sql(self.connection.prepare(query))?;
        let rows = self.sql(statement.query_map([], |row| {
            Ok(CellRecord {
                cell: row.get(0)?,
                since: row.get::<_, i64>(1)?.cast_unsigned(),
                arm: row.get(2)?,
                urdf_sha256: row.get(3)?,
                plant: row.get(4)?,
            })
        }))?;
        rows.map(|row| self.sql(row)).collect()
    }

    /// Makes it durable that a rollout in flight is given to another cell, before that one is asked.
    pub fn put_given(&mut self, rollout: u64, cell: &str) -> Result<(), StoreError> {
        self.transaction(|transaction| insert_given(transaction, rollout, cell))
    }
}

pub(super) fn insert_given(
    transaction: &Transaction<'_>,
    rollout: u64,
    cell: &str,
) -> rusqlite::Result<()> {
    let query = "INSERT OR REPLACE INTO given (rollout, cell) VALUES (?1, ?2)";
    transaction.prepare_cached(query)?.execute(params![rollout.cast_signed(), cell])?;
    Ok(())
}

pub(super) fn insert_cell(
    transaction: &Transaction<'_>,
    record: &CellRecord,
) -> rusqlite::Result<()> {
    let CellRecord { cell, since, arm, urdf_sha256, plant } = record;
    let query =
        "INSERT INTO cells (cell, since, arm, urdf_sha256, plant) VALUES (?1, ?2, ?3, ?4, ?5)";
    let row = params![cell, since.cast_signed(), arm, urdf_sha256, plant];
    transaction.prepare_cached(query)?.execute(row)?;
    Ok(())
}
