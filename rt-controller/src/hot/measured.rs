//! A sample as it comes: whether it is usable, and what of it is recorded.

use physics::plant::Measurement;
use shm_types::episode::{FLAG_IN_CONTACT, TickRecord};

use crate::hot::limits;

/// Every number in it is one.
pub(crate) fn is_finite(measured: &Measurement) -> bool {
    let object = &measured.object;
    let mut of_object = object.p_WO.iter().chain(object.R_WO.coords.iter());
    limits::is_finite(&measured.q)
        && limits::is_finite(&measured.qd)
        && of_object.all(|x| x.is_finite())
}

/// Into the record of its tick.
pub(crate) fn write(measured: &Measurement, record: &mut TickRecord) {
    // The record must stay finite: receivers refuse the whole episode otherwise.
    let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
    for i in 0..record.q.len() {
        record.q[i] = finite(measured.q[i]);
        record.qd[i] = finite(measured.qd[i]);
    }
    let object = &measured.object;
    let rotation = object.R_WO.coords; // i, j, k, w
    for i in 0..3 {
        record.object_position[i] = finite(object.p_WO[i]);
        record.object_quaternion[i + 1] = finite(rotation[i]);
    }
    record.object_quaternion[0] = finite(rotation[3]);
    if object.in_contact {
        record.flags |= FLAG_IN_CONTACT;
    }
}
