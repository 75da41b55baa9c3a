//! One file a verb.

pub mod arm;
pub mod bench;
pub mod child;
pub mod config;
pub mod controller;
pub mod demo;
pub mod doctor;
pub mod judge;
pub mod learn;
pub mod learner;
pub mod live;
pub mod modes;
pub mod plant;
pub mod policy;
pub mod rearm;
pub mod record;
pub mod repertoire;
pub mod replay;
pub mod report;
pub mod shell;
pub mod soak;
pub mod status;
pub mod study;
pub mod task;
pub mod trials;
pub mod watch;
