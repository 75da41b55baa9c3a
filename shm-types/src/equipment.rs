//! What a controller drives: the task, the arm and the plant. It travels with every heartbeat, so that a learner knows
//! a cell before it asks it for anything, and with every episode, so that a trial keeps what executed it.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

use crate::text;

/// Bytes of the name of a task or an arm, and of a plant.
pub const EQUIPMENT_NAME_LEN: usize = 32;
pub const EQUIPMENT_PLANT_LEN: usize = 64;
/// Digits of a URDF's digest that people are shown.
pub const DIGEST_SHOWN: usize = 12;

message! {
    /// Texts as in [`crate::text`]; what is not told is empty.
    pub struct Equipment as "skillet/Equipment/1" {
        pub task: [u8; EQUIPMENT_NAME_LEN],
        /// Name of the robot in its URDF, and SHA-256 of that file. A task without an arm has neither.
        pub arm: [u8; EQUIPMENT_NAME_LEN],
        pub urdf_sha256: [u8; 32],
        /// The built-in simulation, or what the plant in another process called itself, with its version.
        pub plant: [u8; EQUIPMENT_PLANT_LEN],
    }
}

impl Equipment {
    /// What stands for a controller that reports nothing.
    pub const UNKNOWN: Equipment = Equipment {
        task: [0; EQUIPMENT_NAME_LEN],
        arm: [0; EQUIPMENT_NAME_LEN],
        urdf_sha256: [0; 32],
        plant: [0; EQUIPMENT_PLANT_LEN],
    };

    /// Nothing but text where text belongs.
    pub fn is_valid(&self) -> bool {
        text::is_valid(&self.task) && text::is_valid(&self.arm) && text::is_valid(&self.plant)
    }

    pub fn task_name(&self) -> String {
        text::unpack(&self.task)
    }

    pub fn arm_name(&self) -> String {
        text::unpack(&self.arm)
    }

    pub fn plant_name(&self) -> String {
        text::unpack(&self.plant)
    }

    /// SHA-256 of the URDF in hexadecimal; empty without an arm.
    pub fn urdf_text(&self) -> String {
        if self.urdf_sha256 == [0; 32] { String::new() } else { hex(&self.urdf_sha256) }
    }

    /// Task and arm in words: what two machines must have in common. Empty when it tells neither.
    pub fn world(&self) -> String {
        let task = self.task_name();
        match self.urdf_text().get(..DIGEST_SHOWN) {
            _ if task.is_empty() => String::new(),
            Some(digest) => format!("task {task} on the arm with URDF {digest}"),
            None => format!("task {task}"),
        }
    }

    /// It tells of another task or arm than `wanted`. What either does not tell is not compared.
    pub fn has_other_world(&self, wanted: &Equipment) -> bool {
        let is_told = self.task[0] != 0 && wanted.task[0] != 0;
        is_told && (self.task != wanted.task || self.urdf_sha256 != wanted.urdf_sha256)
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wam() -> Equipment {
        Equipment {
            task: text::pack("pancake"),
            arm: text::pack("wam7"),
            urdf_sha256: [0xab; 32],
            plant: text::pack("mujoco"),
        }
    }

    #[test]
    fn task_and_arm_are_compared_and_only_where_both_are_told() {
        let other_arm = Equipment { urdf_sha256: [1; 32], ..wam() };
        let other_task = Equipment { task: text::pack("cup"), ..wam() };
        let other_plant = Equipment { plant: text::pack("real"), ..wam() };
        assert!(other_arm.has_other_world(&wam()) && other_task.has_other_world(&wam()));
        assert!(!other_plant.has_other_world(&wam()), "a plant may differ");
        assert!(!Equipment::UNKNOWN.has_other_world(&wam()));
        assert!(!wam().has_other_world(&Equipment::UNKNOWN));
    }

    #[test]
    fn it_is_shown_in_words() {
        assert_eq!(wam().world(), "task pancake on the arm with URDF abababababab");
        let armless = Equipment { arm: [0; 32], urdf_sha256: [0; 32], ..wam() };
        assert_eq!((armless.world().as_str(), armless.urdf_text().as_str()), ("task pancake", ""));
        assert_eq!(Equipment::UNKNOWN.world(), "");
        let mut spoilt = wam();
        spoilt.plant[40] = 0xff;
        assert!(wam().is_valid() && Equipment::UNKNOWN.is_valid() && !spoilt.is_valid());
    }
}
