//! What a plant in another process and the controller tell each other; `docs/plant-protocol.md` has the
//! rules.
//!
//! A contract of its own, with a version instead of a hash: drivers live longer than builds of Skillet.

use crate::MAX_JOINTS;
use crate::measures::{MAX_MEASURES, Measures, NAME_LEN, UNIT_LEN};
use crate::text::{self, REASON_LEN};
use iceoryx2::prelude::ZeroCopySend;

pub mod line;
pub mod shared;
pub mod socket;

/// Version of the messages below and of their rules.
pub const PLANT_VERSION: u64 = 1;

/// Flags of a [`PlantHello`].
pub const PLANT_SIMULATED: u64 = 1;
pub const PLANT_CAN_RESET: u64 = 2;
pub const PLANT_HAS_OBJECT: u64 = 4;
pub const PLANT_DETERMINISTIC: u64 = 8;
/// It polls shared memory for replies.
pub const PLANT_POLLS: u64 = 16;

/// Flags of a [`PlantState`].
pub const STATE_IN_CONTACT: u64 = 1;
pub const STATE_OBJECT_SEEN: u64 = 2;
pub const STATE_FAULT: u64 = 4;
/// An Outcome was sent before it.
pub const STATE_TOLD: u64 = 8;

/// Modes of a [`PlantCommand`]: no torque in it; apply it; begin another episode; the controller ends.
pub const MODE_HOLD: u64 = 0;
pub const MODE_TRACK: u64 = 1;
pub const MODE_RESET: u64 = 2;
pub const MODE_STOP: u64 = 3;

/// First field of each message.
pub const KIND_HELLO: u64 = 1;
pub const KIND_WELCOME: u64 = 2;
pub const KIND_STATE: u64 = 3;
pub const KIND_COMMAND: u64 = 4;
pub const KIND_OUTCOME: u64 = 5;

/// Bytes of a name of a plant, and of a joint.
pub const PLANT_NAME_LEN: usize = 32;
/// Numbers of a plant's own in each sample.
pub const N_USER: usize = 8;

message! {
    /// Plant to controller, once: who it is and what it expects.
    pub struct PlantHello as "skillet/PlantHello/1" {
        pub kind: u64,
        pub version: u64,
        pub name: [u8; PLANT_NAME_LEN],
        pub n_joints: u64,
        /// `PLANT_*`.
        pub flags: u64,
        pub period_ns: u64,
        /// SHA-256 of the URDF it was made from; zeros if not given.
        pub urdf_sha256: [u8; 32],
        /// An empty name is not compared.
        pub joint_names: [[u8; PLANT_NAME_LEN]; MAX_JOINTS],
        /// Largest torques, N·m; 0 says nothing.
        pub tau_max: [f64; MAX_JOINTS],
        /// Where the arm rests, rad.
        pub q: [f64; MAX_JOINTS],
    }
}

message! {
    /// Controller to plant: accepted, or, at any time, refused and why.
    pub struct PlantWelcome as "skillet/PlantWelcome/1" {
        pub kind: u64,
        pub version: u64,
        pub accepted: u64,
        pub boot_id: u64,
        pub period_ns: u64,
        /// Why it is refused; of one that polls, where it finds its shared memory.
        pub reason: [u8; REASON_LEN],
    }
}

message! {
    /// Plant to controller: one sample.
    pub struct PlantState as "skillet/PlantState/1" {
        pub kind: u64,
        /// Grows with every sample, through resets too.
        pub seq: u64,
        pub episode: u64,
        /// The plant's time, and the monotonic clock of the host at sampling, or 0, ns.
        pub t_ns: u64,
        pub wall_ns: u64,
        /// `STATE_*`.
        pub flags: u64,
        /// Samples without an answer so far.
        pub n_unanswered: u64,
        /// Positions, rad, speeds, rad/s, and measured torques, N·m.
        pub q: [f64; MAX_JOINTS],
        pub qd: [f64; MAX_JOINTS],
        pub tau: [f64; MAX_JOINTS],
        /// Centre of the object in the world, m, and its orientation there, w, x, y, z.
        pub object_position: [f64; 3],
        pub object_quaternion: [f64; 4],
        pub user: [f64; N_USER],
    }
}

message! {
    /// Controller to plant: the answer to a sample.
    pub struct PlantCommand as "skillet/PlantCommand/1" {
        pub kind: u64,
        pub answers_seq: u64,
        /// The one that is wanted, and the session's rollout that it is; 0: none of a session.
        pub episode: u64,
        pub rollout: u64,
        /// `MODE_*`.
        pub mode: u64,
        /// Until when the torque is worth something, ns of the plant's time.
        pub expires_ns: u64,
        /// Samples that the controller missed so far.
        pub n_lost: u64,
        /// N·m.
        pub tau: [f64; MAX_JOINTS],
    }
}

message! {
    /// Plant to controller: what only it can measure of an episode; before its last sample.
    pub struct PlantOutcome as "skillet/PlantOutcome/1" {
        pub kind: u64,
        pub episode: u64,
        pub n: u64,
        pub names: [[u8; NAME_LEN]; MAX_MEASURES],
        pub units: [[u8; UNIT_LEN]; MAX_MEASURES],
        pub values: [f64; MAX_MEASURES],
    }
}

impl PlantHello {
    pub const EMPTY: PlantHello = PlantHello {
        kind: KIND_HELLO,
        version: PLANT_VERSION,
        name: [0; PLANT_NAME_LEN],
        n_joints: 0,
        flags: 0,
        period_ns: 0,
        urdf_sha256: [0; 32],
        joint_names: [[0; PLANT_NAME_LEN]; MAX_JOINTS],
        tau_max: [0.0; MAX_JOINTS],
        q: [0.0; MAX_JOINTS],
    };

    pub fn is_simulated(&self) -> bool {
        self.flags & PLANT_SIMULATED != 0
    }

    /// A simulator that polls shared memory; a real arm sleeps between its samples.
    pub fn polls(&self) -> bool {
        self.is_simulated() && self.flags & PLANT_POLLS != 0
    }

    /// For people.
    pub fn name(&self) -> String {
        text::unpack(&self.name)
    }
}

impl PlantWelcome {
    pub fn accepted(boot_id: u64, period_ns: u64) -> PlantWelcome {
        PlantWelcome { accepted: 1, boot_id, period_ns, ..PlantWelcome::refused("") }
    }

    /// To shared memory, see [`shared::Host::invite`].
    pub fn inviting(self, invitation: &str) -> PlantWelcome {
        PlantWelcome { reason: text::pack(invitation), ..self }
    }

    pub fn refused(why: &str) -> PlantWelcome {
        PlantWelcome {
            kind: KIND_WELCOME,
            version: PLANT_VERSION,
            accepted: 0,
            boot_id: 0,
            period_ns: 0,
            reason: text::pack(why),
        }
    }
}

impl PlantState {
    pub const EMPTY: PlantState = PlantState {
        kind: KIND_STATE,
        seq: 0,
        episode: 0,
        t_ns: 0,
        wall_ns: 0,
        flags: 0,
        n_unanswered: 0,
        q: [0.0; MAX_JOINTS],
        qd: [0.0; MAX_JOINTS],
        tau: [0.0; MAX_JOINTS],
        object_position: [0.0; 3],
        object_quaternion: [1.0, 0.0, 0.0, 0.0],
        user: [0.0; N_USER],
    };
}

impl PlantCommand {
    pub const HOLD: PlantCommand = PlantCommand {
        kind: KIND_COMMAND,
        answers_seq: 0,
        episode: 0,
        rollout: 0,
        mode: MODE_HOLD,
        expires_ns: 0,
        n_lost: 0,
        tau: [0.0; MAX_JOINTS],
    };
}

impl PlantOutcome {
    pub fn new(episode: u64, measures: &Measures) -> PlantOutcome {
        let Measures { n, names, units, values } = *measures;
        PlantOutcome { kind: KIND_OUTCOME, episode, n, names, units, values }
    }

    /// Unchecked, as they came.
    pub fn measures(&self) -> Measures {
        let PlantOutcome { n, names, units, values, .. } = *self;
        Measures { n, names, units, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drivers in other languages are written by these numbers.
    #[test]
    fn messages_are_as_long_as_the_protocol_says() {
        let lengths = [
            size_of::<PlantHello>(),
            size_of::<PlantWelcome>(),
            size_of::<PlantState>(),
            size_of::<PlantCommand>(),
            size_of::<PlantOutcome>(),
        ];
        assert_eq!(lengths, [440, 360, 344, 112, 1560]);
        let page = include_str!("../../docs/plant-protocol.md");
        for (kind, (name, length)) in
            (1..).zip(["Hello", "Welcome", "State", "Command", "Outcome"].iter().zip(lengths))
        {
            assert!(page.contains(&format!("| {name} | {kind} | {length} |")), "{name}");
        }
    }

    #[test]
    fn a_name_is_text_whatever_came() {
        let named = text::pack::<PLANT_NAME_LEN>;
        assert_eq!(text::unpack(&named("wam é")), "wam é");
        let long = "µ".repeat(PLANT_NAME_LEN);
        assert_eq!(text::unpack(&named(&long)), "µ".repeat(PLANT_NAME_LEN / 2));
        assert_eq!(text::unpack(&named("a\x1b[2J")), "a [2J");
        assert!(text::unpack(&[0xff; PLANT_NAME_LEN]).starts_with('\u{fffd}'));
    }
}
