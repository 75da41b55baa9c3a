//! Messages of our own in a recording, as Protocol Buffers; units are in the names of the fields.
//!
//! Every file carries their schema. Numbers of a tick are rounded to a binary grid below what such an
//! arm can be controlled to: random low bits are most of what a compressor cannot compress.

use foxglove::Schema;
use prost::Message as _;
use prost_types::{DescriptorProto, FileDescriptorProto, FileDescriptorSet};
use shm_types::episode::{
    FLAG_BLENDING, FLAG_IN_CONTACT, FLAG_NEAR_JOINT_LIMIT, FLAG_NEAR_SPEED_LIMIT,
    FLAG_RATE_LIMITED, FLAG_TORQUE_CLIPPED,
};
use shm_types::telemetry::TelemetryTick;

use super::loop_policy::LoopPolicy;
use super::schema::{PACKAGE, recorded};

/// Resolutions as negative powers of two: 2⁻¹⁴ rad (61 µrad), 2⁻⁸ rad/s, 2⁻⁵ N·m, 2⁻¹⁴ m and rad (61 µm);
/// coarser what follows from policy and time: 2⁻¹¹ of an attractor, 2⁻⁷ of an activation, 2⁻¹ s⁻².
const POSITION_BITS: i32 = 14;
const SPEED_BITS: i32 = 8;
const TORQUE_BITS: i32 = 5;
const POSE_BITS: i32 = 14;
const ATTRACTOR_BITS: i32 = 11;
const ACTIVATION_BITS: i32 = 7;
const STIFFNESS_BITS: i32 = 1;

/// Ticks are timed in steps of this length.
const TICK_STEP_NS: u64 = 128;
/// First phase in which a policy acts.
const EXECUTE: u32 = 2;

recorded! {
    /// What one tick measured and commanded.
    pub struct Tick {
        "1" [uint64] tick: u64,
        /// 0 Idle, 1 Approach, 2 Execute, 3 Settle.
        "2" [uint32] phase: u32,
        "3" [uint32] fault: u32,
        "4" [float, repeated] q_rad: Vec<f32>,
        "5" [float, repeated] qd_rad_s: Vec<f32>,
        "6" [float, repeated] tau_n_m: Vec<f32>,
        /// Pose of the pan: x, y, z, pitch, roll, yaw, as many as are learnt.
        "7" [float, repeated] pose_m_rad: Vec<f32>,
        /// Σ hᵢ μᵢ of springs, or what the systems draw the pose to, of the same coordinates.
        "8" [float, repeated] attractor_m_rad: Vec<f32>,
        /// hᵢ of the policy in the loop.
        "9" [float, repeated] activations: Vec<f32>,
        /// Σ hᵢ Kᵢ, packed lower triangle by rows of the learnt coordinates; none of systems.
        "10" [float, repeated] stiffness_per_s2: Vec<f32>,
        /// The pancake, not in every tick of a live recording; orientation as w, i, j, k.
        "11" [float, repeated] object_m: Vec<f32>,
        "12" [float, repeated] object_quaternion: Vec<f32>,
        "13" [bool] in_contact: bool,
        "14" [bool] torque_clipped: bool,
        "15" [bool] rate_limited: bool,
        "16" [bool] near_joint_limit: bool,
        "17" [bool] near_speed_limit: bool,
        "18" [bool] blending: bool,
        /// Wake-up after the deadline, and time in the tick itself; absent in what was not timed.
        "19" [uint32, optional] wakeup_us: Option<u32>,
        "20" [uint32, optional] tick_ns: Option<u32>,
        "21" [uint64] deadlines_missed: u64,
        /// Digest of the policy in the loop.
        "22" [uint64] policy_digest: u64,
    }
}

recorded! {
    /// One spring of a policy.
    pub struct Spring {
        /// Centre of its activation: s, or the decay's phase.
        "1" [double] center: f64,
        "2" [double] width: f64,
        "3" [double, repeated] attractor_m_rad: Vec<f64>,
        /// Packed lower triangle by rows.
        "4" [double, repeated] stiffness_per_s2: Vec<f64>,
    }
}

recorded! {
    /// One linear system of a policy: its Gaussian, and Aᵢ and bᵢ of Eq. (2).
    pub struct System {
        "1" [double] log_prior: f64,
        /// Mean of what drives the activations: s, the decay's phase, or the learnt coordinates.
        "2" [double, repeated] center: Vec<f64>,
        /// Packed lower triangle by rows.
        "3" [double, repeated] covariance: Vec<f64>,
        /// Matrices over the learnt coordinates, by rows.
        "4" [double, repeated] of_position: Vec<f64>,
        "5" [double, repeated] of_velocity: Vec<f64>,
        "6" [double, repeated] of_drive: Vec<f64>,
        "7" [double, repeated] offset: Vec<f64>,
    }
}

recorded! {
    /// A policy that went into the loop.
    pub struct Policy {
        "1" [uint64] digest: u64,
        "2" [uint64] session: u64,
        "3" [uint64] rollout: u64,
        "4" [uint64] policy_id: u64,
        "5" [uint32] task_dim: u32,
        "6" [double] duration_s: f64,
        "7" [double] decay_per_s: f64,
        "8" [double] damping_per_s: f64,
        "9" [message, repeated] springs: Vec<Spring>,
        /// The action of a task without an arm.
        "10" [double, repeated] action: Vec<f64>,
        /// ζ: where it is not 0, spring i damps with 2ζ Kᵢ^½ instead.
        "11" [double] damping_ratio: f64,
        "12" [message, repeated] systems: Vec<System>,
        /// What drives the activations: 0 time, 1 decay, 2 the state.
        "13" [uint32] activation: u32,
        /// What systems yield: 0 accelerations, 1 velocities, which are followed at the rate below.
        "14" [uint32] output: u32,
        "15" [double] following_per_s: f64,
        /// Errors of orientation: 0 differences of rotation vectors, 1 rotations.
        "16" [uint32] orientation: u32,
        /// The target of systems: x, y, z, pitch, roll, yaw.
        "17" [double, repeated] target_m_rad: Vec<f64>,
    }
}

recorded! {
    /// A rollout that has ended.
    pub struct Outcome {
        "1" [uint64] session: u64,
        "2" [uint64] rollout: u64,
        "3" [uint64] policy_digest: u64,
        "4" [uint64] applied_tick: u64,
        "5" [uint64] n_records: u64,
        "6" [uint64] fault: u64,
    }
}

recorded! {
    /// One number of what was measured of a rollout.
    pub struct Measure {
        "1" [string] name: String,
        /// `1` for a number without unit, `bool` for a truth value, 1 or 0.
        "2" [string] unit: String,
        "3" [double] value: f64,
    }
}

recorded! {
    /// What was measured of a rollout.
    pub struct Measures {
        "1" [uint64] session: u64,
        "2" [uint64] rollout: u64,
        "3" [uint64] policy_digest: u64,
        "4" [message, repeated] measures: Vec<Measure>,
    }
}

recorded! {
    /// What was learnt from a rollout.
    pub struct Trial {
        "1" [uint64] session: u64,
        "2" [uint64] rollout: u64,
        "3" [uint64] policy_digest: u64,
        "4" [double] reward: f64,
        "5" [bool] success: bool,
        "6" [bool] set_aside: bool,
        "7" [uint64] fault: u64,
    }
}

recorded! {
    /// One mode of the search.
    pub struct Mode {
        "1" [uint32] number: u32,
        "2" [double] prior: f64,
        "3" [uint64] n_trials: u64,
        /// 0: it has none.
        "4" [uint64] best_rollout: u64,
        "5" [double] best_reward: f64,
        "6" [double, optional] tolerance: Option<f64>,
        "7" [bool] forbidden: bool,
        /// In the scaled space of the search: mean, and covariance by columns; empty where only the
        /// learner knows them.
        "8" [double, repeated] mean: Vec<f64>,
        "9" [double, repeated] covariance: Vec<f64>,
    }
}

recorded! {
    /// The mixture the search has found.
    pub struct Mixture {
        "1" [message, repeated] modes: Vec<Mode>,
    }
}

/// The schema of `message`, with all our messages beside it: some hold others.
fn schema(message: &str) -> Schema {
    let file = FileDescriptorProto {
        name: Some("skillet.proto".into()),
        package: Some(PACKAGE.into()),
        syntax: Some("proto3".into()),
        message_type: descriptors(),
        ..FileDescriptorProto::default()
    };
    let set = FileDescriptorSet { file: vec![file] };
    Schema::new(format!("{PACKAGE}.{message}"), "protobuf", set.encode_to_vec())
}

/// The descriptors of all messages.
fn descriptors() -> Vec<DescriptorProto> {
    vec![
        Tick::descriptor(),
        Spring::descriptor(),
        System::descriptor(),
        Policy::descriptor(),
        Outcome::descriptor(),
        Measure::descriptor(),
        Measures::descriptor(),
        Trial::descriptor(),
        Mode::descriptor(),
        Mixture::descriptor(),
    ]
}

impl Tick {
    /// `policy` is the one in the loop, as far as it is known.
    pub fn new(
        seen: &TelemetryTick,
        n_joints: usize,
        policy: Option<&LoopPolicy>,
        with_object: bool,
    ) -> Tick {
        let record = &seen.record;
        let is = |flag| record.flags & flag != 0;
        // Without a wall clock nobody woke up.
        let is_timed = seen.tick_ns > 0;
        let timed = |time: u64| is_timed.then_some(u32::try_from(time).unwrap_or(u32::MAX));
        let n_learnt = policy.map_or(record.x.len(), LoopPolicy::task_dim);
        let acting = policy.filter(|_| record.phase >= EXECUTE);
        let of_object = |values: &[f64]| match with_object {
            true => rounded(values, POSE_BITS),
            false => Vec::new(),
        };
        let (activations, stiffness) = acting.map_or_else(Default::default, |p| p.at(record));
        Tick {
            tick: record.tick,
            phase: record.phase,
            fault: record.fault,
            q_rad: rounded(&record.q[..n_joints], POSITION_BITS),
            qd_rad_s: rounded(&record.qd[..n_joints], SPEED_BITS),
            tau_n_m: rounded(&record.tau[..n_joints], TORQUE_BITS),
            pose_m_rad: rounded(&record.x[..n_learnt], POSE_BITS),
            attractor_m_rad: rounded(&record.attractor[..n_learnt], ATTRACTOR_BITS),
            activations: rounded(&activations, ACTIVATION_BITS),
            stiffness_per_s2: rounded(&stiffness, STIFFNESS_BITS),
            object_m: of_object(&record.object_position),
            object_quaternion: of_object(&record.object_quaternion),
            in_contact: is(FLAG_IN_CONTACT),
            torque_clipped: is(FLAG_TORQUE_CLIPPED),
            rate_limited: is(FLAG_RATE_LIMITED),
            near_joint_limit: is(FLAG_NEAR_JOINT_LIMIT),
            near_speed_limit: is(FLAG_NEAR_SPEED_LIMIT),
            blending: is(FLAG_BLENDING),
            wakeup_us: timed(seen.wakeup_ns / 1000),
            tick_ns: timed(seen.tick_ns / TICK_STEP_NS * TICK_STEP_NS),
            deadlines_missed: seen.missed,
            policy_digest: seen.policy_digest,
        }
    }
}

/// On the grid of 2⁻ᵇⁱᵗˢ.
fn rounded(values: &[f64], bits: i32) -> Vec<f32> {
    let grid = f64::from(bits).exp2();
    values.iter().map(|value| ((value * grid).round() / grid) as f32).collect()
}
