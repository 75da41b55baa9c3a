//! What the cells drive: another task or arm is of no use to the session, another plant is said.

use std::collections::BTreeMap;

use shm_types::episode::EpisodeHeader;

use super::{Event, Session};
use crate::error::CompleteError;
use crate::store::CellRecord;

/// The plants that cells are known to have, by the names of these.
pub(super) struct Plants(BTreeMap<String, String>);

impl Plants {
    /// Those of the session so far; `cells` are in the order of their trials.
    pub fn of(cells: &[CellRecord]) -> Plants {
        Plants(cells.iter().map(|known| (known.cell.clone(), known.plant.clone())).collect())
    }

    /// Takes note of a cell's plant. What it had before, or else what another cell has, if that is another one.
    fn note(&mut self, cell: &str, plant: &str) -> Option<(String, String)> {
        let before = self.0.insert(cell.into(), plant.into());
        let others = self.0.iter().filter(|(other, _)| *other != cell);
        let mut others = others.map(|(other, plant)| (other.clone(), plant.clone()));
        match before {
            Some(before) => Some((cell.into(), before)).filter(|(_, before)| before != plant),
            None => others.find(|(_, other)| other != plant),
        }
    }
}

impl Session<'_> {
    /// Holds cell `k` back while it drives something else than the session, and says what is new of its plant.
    pub(super) fn look_at_equipment(&mut self, k: usize) {
        let link = &mut self.links[k];
        if !std::mem::take(&mut link.has_equipment_news) {
            return;
        }
        let (had_other, equipment) = (link.is_other, link.equipment);
        link.is_other = equipment.has_other_world(&self.wanted);
        let cell = link.name().to_string();
        if link.is_other {
            // Its rollout is for others, and for itself when it has the right controller.
            link.asked = None;
            let (found, wanted) = (equipment.world(), self.wanted.world());
            (self.on_event)(Event::OtherWorld { cell: &cell, found, wanted });
            return;
        }
        if had_other {
            (self.on_event)(Event::SameWorld { cell: &cell });
        }
        let plant = equipment.plant_name();
        if !plant.is_empty()
            && let Some((of, other)) = self.plants.note(&cell, &plant)
        {
            (self.on_event)(Event::OtherPlant { cell: &cell, plant, of, other });
        }
    }

    /// That an episode was executed by what the session needs.
    pub(super) fn check_equipment(&self, header: &EpisodeHeader) -> Result<(), CompleteError> {
        if !header.equipment.has_other_world(&self.wanted) {
            return Ok(());
        }
        let (found, wanted) = (header.equipment.world(), self.wanted.world());
        Err(CompleteError::OtherWorld { rollout: header.rollout, found, wanted })
    }
}
