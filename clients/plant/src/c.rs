//! The same for C: `include/skillet_plant.h` says what each function does.

// What C hands over are pointers, and its names are its own.
#![allow(unsafe_code)]
#![allow(non_camel_case_types)]

use std::ffi::{CStr, c_char, c_double, c_int};
use std::ptr::null_mut;
use std::time::Duration;

use crate::{Answer, Description, MAX_JOINTS, Object, Plant, PlantError, Sample, socket};

/// Bytes of the text of an error, with the zero at its end.
const ERROR_LEN: usize = 512;

/// As in the header.
#[repr(C)]
pub struct skillet_description {
    name: *const c_char,
    cell: *const c_char,
    n_joints: c_int,
    simulated: c_int,
    has_object: c_int,
    deterministic: c_int,
    polls: c_int,
    period_s: c_double,
    joint_names: [*const c_char; MAX_JOINTS],
    torque_limits: [c_double; MAX_JOINTS],
    q: [c_double; MAX_JOINTS],
}

/// As in the header.
#[repr(C)]
pub struct skillet_sample {
    t_ns: u64,
    q: [c_double; MAX_JOINTS],
    qd: [c_double; MAX_JOINTS],
    tau: [c_double; MAX_JOINTS],
    has_object: c_int,
    in_contact: c_int,
    object_position: [c_double; 3],
    object_quaternion: [c_double; 4],
}

/// A plant and its last error.
pub struct skillet_plant {
    plant: Plant,
    error: [c_char; ERROR_LEN],
}

const ERROR: c_int = -1;
const TORQUE: c_int = 0;
const RESET: c_int = 1;
const HOLD: c_int = 2;
const STOP: c_int = 3;

/// # Safety
/// `text` is null or a string.
unsafe fn text<'a>(text: *const c_char) -> Option<&'a str> {
    if text.is_null() {
        return None;
    }
    // SAFETY: the caller's.
    unsafe { CStr::from_ptr(text) }.to_str().ok()
}

fn put(error: &str, into: &mut [c_char]) {
    let room = into.len() - 1;
    let bytes = error.bytes().filter(|byte| *byte != 0).take(room).chain([0]);
    into.iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte as c_char);
}

/// # Safety
/// `description` points to one whose strings are strings or null; `error` to `error_len` bytes, or is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_open(
    description: *const skillet_description,
    error: *mut c_char,
    error_len: usize,
) -> *mut skillet_plant {
    // SAFETY: the caller's; null is none.
    let result = match unsafe { description.as_ref() } {
        // SAFETY: the caller's.
        Some(description) => unsafe { open(description) }.map_err(|error| error.to_string()),
        None => Err("the description is missing".to_string()),
    };
    match result {
        Ok(plant) => Box::into_raw(Box::new(skillet_plant { plant, error: [0; ERROR_LEN] })),
        Err(why) => {
            if !error.is_null() && error_len > 0 {
                // SAFETY: the caller's.
                put(&why, unsafe { std::slice::from_raw_parts_mut(error, error_len) });
            }
            null_mut()
        }
    }
}

/// # Safety
/// The strings of `said` are strings or null.
unsafe fn open(said: &skillet_description) -> Result<Plant, PlantError> {
    let n_joints = usize::try_from(said.n_joints).unwrap_or(0);
    // SAFETY: the caller's.
    let names = said.joint_names.map(|name| unsafe { text(name) }.unwrap_or(""));
    let n = n_joints.min(MAX_JOINTS);
    let simulated = said.simulated != 0;
    let description = Description {
        // SAFETY: the caller's.
        name: unsafe { text(said.name) }.unwrap_or("plant"),
        n_joints,
        period_s: said.period_s,
        is_simulated: simulated,
        can_reset: simulated,
        has_object: said.has_object != 0,
        is_deterministic: said.deterministic != 0,
        polls: said.polls != 0,
        joint_names: &names[..n],
        torque_limits: &said.torque_limits[..n],
        urdf_sha256: None,
        q: said.q,
    };
    // SAFETY: the caller's.
    Plant::connect(&socket(unsafe { text(said.cell) })?, &description)
}

/// # Safety
/// `plant` is from `skillet_plant_open`, `sample` points to one, `tau` to 7 numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_exchange(
    plant: *mut skillet_plant,
    sample: *const skillet_sample,
    tau: *mut c_double,
) -> c_int {
    // SAFETY: the caller's; null is none.
    match unsafe { (plant.as_mut(), sample.as_ref()) } {
        (Some(plant), Some(sample)) => {
            let answer = plant.plant.exchange(&sample_of(sample));
            // SAFETY: the caller's.
            unsafe { give(plant, answer, tau) }
        }
        _ => ERROR,
    }
}

/// # Safety
/// As of `skillet_plant_exchange`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_send(
    plant: *mut skillet_plant,
    sample: *const skillet_sample,
) -> c_int {
    // SAFETY: the caller's; null is none.
    match unsafe { (plant.as_mut(), sample.as_ref()) } {
        (Some(plant), Some(sample)) => match plant.plant.send(&sample_of(sample)) {
            Ok(()) => 0,
            Err(error) => {
                put(&error.to_string(), &mut plant.error);
                ERROR
            }
        },
        _ => ERROR,
    }
}

/// # Safety
/// As of `skillet_plant_exchange`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_answer(
    plant: *mut skillet_plant,
    patience_us: u32,
    tau: *mut c_double,
) -> c_int {
    // SAFETY: the caller's; null is none.
    let Some(plant) = (unsafe { plant.as_mut() }) else { return ERROR };
    let answer = plant.plant.answer(Duration::from_micros(patience_us.into()));
    // SAFETY: the caller's.
    unsafe { give(plant, answer, tau) }
}

/// # Safety
/// `plant` is null or from `skillet_plant_open`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_has_reset(plant: *mut skillet_plant) {
    // SAFETY: the caller's; null is none.
    if let Some(plant) = unsafe { plant.as_mut() } {
        plant.plant.has_reset();
    }
}

/// # Safety
/// `plant` is null or from `skillet_plant_open`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_rollout(plant: *const skillet_plant) -> u64 {
    // SAFETY: the caller's; null is none.
    unsafe { plant.as_ref() }.map_or(0, |plant| plant.plant.rollout())
}

/// # Safety
/// `plant` is null or from `skillet_plant_open`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_error(plant: *const skillet_plant) -> *const c_char {
    // SAFETY: the caller's; null is none.
    unsafe { plant.as_ref() }.map_or(c"the plant is missing".as_ptr(), |plant| plant.error.as_ptr())
}

/// # Safety
/// `plant` is null or from `skillet_plant_open`, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn skillet_plant_close(plant: *mut skillet_plant) {
    if !plant.is_null() {
        // SAFETY: the caller's.
        drop(unsafe { Box::from_raw(plant) });
    }
}

fn sample_of(sample: &skillet_sample) -> Sample {
    let object = Object {
        position: sample.object_position,
        quaternion: sample.object_quaternion,
        in_contact: sample.in_contact != 0,
    };
    Sample {
        t_ns: (sample.t_ns != 0).then_some(sample.t_ns),
        q: sample.q,
        qd: sample.qd,
        tau: sample.tau,
        object: (sample.has_object != 0).then_some(object),
    }
}

/// # Safety
/// `tau` points to 7 numbers, or is null.
unsafe fn give(
    plant: &mut skillet_plant,
    answer: Result<Answer, PlantError>,
    tau: *mut c_double,
) -> c_int {
    let (code, torque) = match answer {
        Ok(Answer::Torque(torque)) => (TORQUE, Some(torque)),
        Ok(Answer::Reset(torque)) => (RESET, Some(torque)),
        Ok(Answer::Hold) => (HOLD, None),
        Ok(Answer::Stop) => (STOP, None),
        Err(error) => {
            put(&error.to_string(), &mut plant.error);
            (ERROR, None)
        }
    };
    if let Some(torque) = torque.filter(|_| !tau.is_null()) {
        // SAFETY: the caller's.
        unsafe { std::slice::from_raw_parts_mut(tau, MAX_JOINTS) }.copy_from_slice(&torque);
    }
    code
}
