//! The report of a learning session: one HTML page and its figures as SVG files.
//!
//! ```text
//! let html = report::render(&data);
//! for (stem, svg) in report::figures(&data) { /* write {stem}.svg */ }
//! ```
//!
//! Everything is drawn from [`ReportData`]; what the data lacks is named in place of the figure.
//! The page needs no script and no other file.

mod actions;
mod attractors;
mod coordinates;
pub mod figure;
pub mod map;
mod outcomes;
mod page;
mod plane;
pub mod plot;
mod reward;
#[cfg(test)]
mod sample;
mod side_view;
mod stiffness;
mod strip;
pub mod style;
mod summary;
pub mod svg;

use learner::path::PathRow;
use shm_types::episode::OutcomeMsg;
use shm_types::policy::PolicyMsg;

use figure::Figure;
pub use plane::{ModeRow, Plane, Reward};

/// What a report shows.
pub struct ReportData {
    pub task: String,
    /// Name of the session's folder.
    pub session: String,
    pub seed: u64,
    pub config_toml: String,
    /// In order; rollouts count from 1.
    pub trials: Vec<TrialRow>,
    pub initial: PolicyMsg,
    /// Policy of the best successful trial, or of the best one if none succeeded.
    pub learnt: PolicyMsg,
    pub learnt_rollout: u64,
    /// 100 Hz, from the start of Execute; empty if not recorded.
    pub initial_path: Vec<PathRow>,
    pub learnt_path: Vec<PathRow>,
    pub learnt_outcome: OutcomeMsg,
    /// Further names and values for the summary.
    pub notes: Vec<(String, String)>,
    /// Instead of a flip: what a task without an arm shows.
    pub plane: Option<Plane>,
}

/// One rollout as the report shows it.
pub struct TrialRow {
    pub rollout: u64,
    pub reward: f64,
    pub success: bool,
    pub outcome: OutcomeMsg,
    /// First fault of the rollout, or 0.
    pub fault: u64,
}

/// The complete page.
pub fn render(data: &ReportData) -> String {
    match &data.plane {
        Some(plane) => actions::html(data, plane, &all_figures(data)),
        None => page::html(data, &all_figures(data)),
    }
}

/// File stem and content of every figure the data allows.
pub fn figures(data: &ReportData) -> Vec<(&'static str, String)> {
    let figures = all_figures(data);
    figures.iter().filter_map(|figure| Some((figure.stem, figure.svg()?))).collect()
}

fn all_figures(data: &ReportData) -> Vec<Figure> {
    if let Some(plane) = &data.plane {
        return vec![plane::figure(plane), reward::figure(data)];
    }
    vec![
        reward::figure(data),
        strip::figure(data),
        stiffness::figure(data),
        attractors::figure(data),
        coordinates::figure(data),
        outcomes::figure(data),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every drawing and the page, with no number that is not one.
    fn render_all(data: &ReportData) -> String {
        let figures: String = figures(data).into_iter().map(|(_, svg)| svg).collect();
        let page = render(data);
        for text in [&figures, &page] {
            assert!(!text.contains("NaN") && !text.contains("inf\"") && !text.contains("inf "));
        }
        page
    }

    #[test]
    fn a_complete_session_has_every_figure_and_stays_below_a_megabyte() {
        let data = sample::session(100);
        assert_eq!(figures(&data).len(), 6);
        let page = render_all(&data);
        assert!(page.len() < 1_000_000 && !page.contains("is missing"));
        assert!(
            !page.contains("http://") && !page.contains("https://") && !page.contains("<script")
        );
    }

    #[test]
    fn elements_are_balanced() {
        let data = sample::session(20);
        let page = render(&data);
        let all = figures(&data).into_iter().map(|(_, svg)| svg).chain([page]);
        for text in all {
            for tag in ["svg", "g", "text", "figure", "section", "table", "tr", "div", "details"] {
                let open = text.matches(&format!("<{tag} ")).count()
                    + text.matches(&format!("<{tag}>")).count();
                assert_eq!(open, text.matches(&format!("</{tag}>")).count(), "{tag}");
            }
        }
    }

    #[test]
    fn says_what_is_missing_instead_of_failing() {
        let mut data = sample::session(0);
        (data.initial, data.learnt) = (PolicyMsg::EMPTY, PolicyMsg::EMPTY);
        data.initial_path.clear();
        data.learnt_path.clear();
        let page = render_all(&data);
        assert_eq!(page.matches("is missing").count(), 6);
        assert_eq!(figures(&data).len(), 0);
    }

    #[test]
    fn draws_a_session_of_one_rollout_without_success() {
        let mut data = sample::session(1);
        data.trials[0].success = false;
        data.trials[0].outcome = OutcomeMsg::ZERO;
        data.learnt_outcome = OutcomeMsg::ZERO;
        data.learnt_path.truncate(1);
        assert!(render_all(&data).contains("No caught flip"));
        data.initial = PolicyMsg::EMPTY;
        render_all(&data);
    }

    #[test]
    fn survives_values_that_are_not_finite() {
        let mut data = sample::session(5);
        data.trials[2].reward = f64::NAN;
        data.trials[3].outcome.apex_m = f64::INFINITY;
        data.trials[3].outcome.lateral_m = f64::NAN;
        data.learnt.components[1].stiffness = [f64::NAN; shm_types::PACKED];
        data.learnt.components[2].attractor[0] = f64::INFINITY;
        data.learnt_path[7].pan_position[2] = f32::NAN;
        data.learnt_outcome.release_time_s = f64::NAN;
        render_all(&data);
    }

    #[test]
    fn escapes_what_the_session_says() {
        let mut data = sample::session(3);
        data.task = "<b>pancake".into();
        data.session = "a&b".into();
        data.config_toml = "name = \"</pre><script>\"".into();
        data.notes = vec![("<u>".into(), "\"x\"".into())];
        let page = render(&data);
        for raw in ["<b>pancake", "a&b", "<script>", "<u>"] {
            assert!(!page.contains(raw), "{raw}");
        }
        assert!(page.contains("&lt;/pre&gt;&lt;script&gt;"));
    }
}
