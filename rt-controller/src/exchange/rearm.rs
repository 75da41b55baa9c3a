//! Hardware faults on the exchange thread: stores, reports and re-arms them, and writes their flight
//! records to disk.

use crate::disk::flight_files::csv;
use crate::exchange::Exchange;
use crate::exchange::commands::Refusal;
use crate::executor::latch::Latched;
use crate::fault::Fault;

impl<P: Clone + PartialEq> Exchange<'_, P> {
    /// Handles a fault that the loop latched, and its reply to a re-arm.
    pub(crate) fn watch_latch(&mut self) {
        let fault = self.setup.latch.fault();
        if let (Some(fault), None) = (fault, self.latched) {
            self.latched = Some(Latched::now(fault));
            self.remember();
            let why = Fault::describe(fault as u32);
            tracing::error!("the arm is held: {why}; run `skillet rearm` to resume");
        }
        if !self.is_rearming {
            return;
        }
        let Some(answer) = self.setup.latch.answer() else { return };
        self.is_rearming = false;
        match answer {
            // It came back before the loop was asked.
            Err(fault) => self.answer_rearmed(Err(fault)),
            Ok(()) => {
                self.latched = None;
                tracing::info!("re-armed");
                let ticket = self.remember();
                self.answer_rearmed(Ok(ticket));
            }
        }
    }

    /// Makes the loop hold the arm.
    pub(crate) fn hold(&mut self) -> Result<(), Refusal> {
        if self.setup.n_joints == 0 {
            return Err(Refusal::NoArm);
        }
        self.setup.latch.hold();
        Ok(())
    }

    /// Makes the loop re-arm.
    pub(crate) fn rearm(&mut self) -> Result<(), Refusal> {
        let Latched { fault, .. } = self.latched.ok_or(Refusal::NothingLatched)?;
        if self.setup.latch.is_present() {
            return Err(Refusal::StillPresent(Fault::describe(fault as u32)));
        }
        self.setup.latch.ask();
        self.is_rearming = true;
        Ok(())
    }

    /// Nothing may be swapped in behind a latched fault.
    pub(crate) fn expect_armed(&self) -> Result<(), Refusal> {
        match self.latched {
            Some(latched) => Err(Refusal::Latched(Fault::describe(latched.fault as u32))),
            None => Ok(()),
        }
    }

    /// Writes the loop's flight records to disk, and returns their boxes.
    pub(crate) fn take_flights(&mut self) {
        while let Ok(mut record) = self.ends.flights.pop() {
            self.active = true;
            if let (Some(files), Some(last)) = (&mut self.flights, record.last()) {
                let path = files.add(self.boot_id, last.tick);
                let why = Fault::describe(last.fault);
                tracing::warn!("fault: {why}; the ticks before it are in {}", path.display());
                self.catalogue.order(path, csv(&record, self.setup.n_joints));
            }
            record.clear();
            // Never full: there are two boxes.
            let _ = self.ends.spare_flights.push(record);
        }
    }
}
