//! `skillet convert`: its flags.

use std::path::PathBuf;

use clap::Args;

#[derive(Args)]
#[command(after_help = "\
Examples:
  skillet convert kitchen.mcap --ros2                 the bag kitchen-ros2
  skillet convert sessions/pancake-1 --ros2           the best trial, rerun: sessions/pancake-1/trial-91-ros2
  skillet convert sessions/pancake-1 --ros2 --trial 7 -o flip
  ros2 bag play flip

A bag is a folder with metadata.yaml and an MCAP file in CDR encoding; rosbag2 reads it with its mcap
plugin. Topics: /joint_states, /tf, /tf_static, /robot_description, /skillet/pose, /skillet/pose_desired,
/skillet/wrench, /skillet/policy, /rosout. Exits 1 if the rerun trial differs
from the stored one; the bag holds the rerun.")]
pub struct ConvertArgs {
    /// Recording (NAME.mcap), or session folder
    pub input: PathBuf,
    /// Write a ROS 2 bag
    #[arg(long, required = true)]
    pub ros2: bool,
    /// Rollout of a session to rerun and convert [default: the best one]
    #[arg(long, visible_alias = "rollout")]
    pub trial: Option<u64>,
    /// Folder to write [default: NAME-ros2 beside the recording, or trial-N-ros2 in the session]
    #[arg(short, long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Replace an existing bag
    #[arg(long)]
    pub force: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
