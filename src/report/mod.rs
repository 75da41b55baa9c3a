//! The report of a learning session, or of several: one HTML page and its figures as SVG files.
//!
//! ```text
//! let figures = report::figures(&data);
//! let html = report::render(&data, &figures);
//! ```
//!
//! Everything is drawn from [`ReportData`]; a figure that the data does not allow is left out, and the page says why.
//! The page needs no script and no other file; it links to those beside it.

mod activations;
mod attractors;
mod bodies;
mod comparison;
mod coordinates;
mod ellipsoids;
mod film;
mod measures;
mod modes;
mod motion;
mod origin;
mod outcomes;
mod page;
mod paths;
mod plane;
mod principal;
mod reward;
mod robustness;
#[cfg(test)]
mod sample;
mod several;
mod side_view;
mod stage;
mod stiffness;
mod strip;
mod summary;
mod terms;
mod timing;
mod trials;

use learner::Demonstration;
use learner::path::PathRow;
use nalgebra::DVector;
use rt_controller::disk::timing_file::LoopTiming;
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use crate::draw::figure::Figure;
pub use comparison::html as render_several;
pub use film::{Film, Links, Look, followed, follows_tip};
pub use modes::ModeRow;
pub use origin::{LinkTo, Origin};
pub use plane::Plane;
pub use robustness::{Attempt, Circumstance, Robustness};
pub use several::{Session, figures as figures_of_several};
pub use terms::Term;

/// What a success of a toss is called.
pub const FLIP: &str = "caught flip";

/// What a report shows.
pub struct ReportData {
    pub task: String,
    /// Name of the session's folder.
    pub session: String,
    pub seed: u64,
    pub config_toml: String,
    /// In order; rollouts count from 1.
    pub trials: Vec<TrialRow>,
    /// What the reward of every trial was the sum of; empty where it is no sum.
    pub terms: Vec<Term>,
    pub initial: PolicyMsg,
    /// Policy of the best successful trial, or of the best one if none succeeded.
    pub learnt: PolicyMsg,
    pub learnt_rollout: u64,
    /// 100 Hz, from the start of Execute; empty if not recorded.
    pub initial_path: Vec<PathRow>,
    /// The rollout of `learnt`.
    pub film: Film,
    /// What the arm looks like, if there is one.
    pub look: Option<Look>,
    pub demonstrations: Vec<Demonstration>,
    pub learnt_measures: Measures,
    /// Further names and values for the summary.
    pub notes: Vec<(String, String)>,
    /// What the search had found when it last stopped; none before.
    pub modes: Vec<ModeRow>,
    /// The selected policy in other worlds, or why it was not tried.
    pub robustness: Result<Robustness, String>,
    /// One entry a pace, or why there are none.
    pub timing: Result<Vec<LoopTiming>, String>,
    pub pictures: Pictures,
    /// What the arm carries; empty without an arm.
    pub tip: &'static str,
    /// What is tracked; empty where nothing is.
    pub object: &'static str,
    /// What a success is called; none where only the reward distinguishes rollouts.
    pub success: Option<&'static str>,
    pub origin: Origin,
    /// Files beside the page.
    pub files: Vec<LinkTo>,
}

impl ReportData {
    fn plane(&self) -> Option<&Plane> {
        match &self.pictures {
            Pictures::Plane(plane) => Some(plane),
            _ => None,
        }
    }

    fn is_toss(&self) -> bool {
        matches!(self.pictures, Pictures::Toss)
    }

    /// Why there is nothing to draw of the springs, if there is not.
    fn without_springs(&self) -> Option<String> {
        let reason = match (self.learnt.n_systems, self.learnt.n_components) {
            (0, 0) => "the session has no learnt policy.",
            (0, _) => return None,
            _ => "a policy of systems has no springs.",
        };
        Some(reason.to_owned())
    }

    /// A success is a caught flip, not what a judge of one's own calls one.
    fn counts_flips(&self) -> bool {
        self.is_toss() && self.success == Some(FLIP)
    }

    /// What successes are called.
    fn successes(&self) -> &'static str {
        if self.counts_flips() { "caught flips" } else { "successes" }
    }

    /// What the paths of the object show: the tip where nothing is tracked.
    fn followed(&self) -> &'static str {
        if self.object.is_empty() { self.tip } else { self.object }
    }

    /// The policy is an action vector.
    fn is_action(&self) -> bool {
        self.initial.n_actions > 0
    }
}

/// What a report shows beside reward and measures.
pub enum Pictures {
    /// An object that is tossed off the pan and caught again.
    Toss,
    /// The plane that is searched, with what is known of its rewards.
    Plane(Plane),
    /// Nothing of its own.
    Plain,
}

/// One rollout as the report shows it.
pub struct TrialRow {
    pub rollout: u64,
    /// The policy's parameters, in the scaled units of the search.
    pub theta: DVector<f64>,
    pub reward: f64,
    pub success: bool,
    /// It executed the mean of the search, no draw.
    pub is_mean: bool,
    pub measures: Measures,
    /// First fault of the rollout, or 0.
    pub fault: u64,
}

/// When something happened, s; 0 where it was not measured, or never did.
fn time(measures: &Measures, name: &str) -> f64 {
    measures.get(name).unwrap_or(0.0)
}

/// The complete page of a session.
pub fn render(data: &ReportData, figures: &[Figure]) -> String {
    page::html(data, figures)
}

/// Every figure of a session, in the order of the page; those the data does not allow say why.
pub fn figures(data: &ReportData) -> Vec<Figure> {
    if let Some(plane) = data.plane() {
        return vec![plane::figure(data, plane), reward::figure(data)];
    }
    if data.is_action() {
        return vec![
            reward::figure(data),
            modes::figure(data),
            terms::figure(data),
            measures::figure(data),
        ];
    }
    let [wakeup, tick] = timing::figures(&data.timing);
    let mut figures = vec![motion::figure(data), reward::figure(data)];
    if data.is_toss() {
        figures.push(strip::figure(data));
    }
    figures.extend([attractors::figure(data), ellipsoids::figure(data)]);
    if !data.is_toss() {
        figures.push(paths::figure(data));
    }
    figures.extend([
        coordinates::figure(data),
        terms::figure(data),
        if data.is_toss() { outcomes::figure(data) } else { measures::figure(data) },
        stiffness::figure(data),
        activations::figure(data),
        modes::figure(data),
    ]);
    if data.is_toss() {
        figures.push(robustness::figure(data));
    }
    figures.extend([modes::in_motion(data), wakeup, tick]);
    figures
}

#[cfg(test)]
mod tests;
