//! The report of a learning session: one HTML page and its figures as SVG files.
//!
//! ```text
//! let html = report::render(&data);
//! for (stem, svg) in report::figures(&data) { /* write {stem}.svg, or remove it */ }
//! ```
//!
//! Everything is drawn from [`ReportData`]; what the data lacks is named in place of the figure.
//! The page needs no script and no other file.

mod activations;
mod animation;
mod attractors;
mod coordinates;
mod ellipsoids;
mod measures;
mod modes;
mod outcomes;
mod page;
mod paths;
mod plane;
mod principal;
mod reward;
#[cfg(test)]
mod sample;
mod side_view;
mod stiffness;
mod strip;
mod summary;
mod timing;

use learner::path::PathRow;
use nalgebra::DVector;
use rt_controller::disk::timing_file::LoopTiming;
use shm_types::measures::Measures;
use shm_types::policy::PolicyMsg;

use crate::draw::figure::Figure;
pub use modes::ModeRow;
pub use plane::Plane;

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
    pub learnt_measures: Measures,
    /// Further names and values for the summary.
    pub notes: Vec<(String, String)>,
    /// What the search had found when it last stopped; none before.
    pub modes: Vec<ModeRow>,
    /// One entry a pace, or why there are none.
    pub timing: Result<Vec<LoopTiming>, String>,
    pub pictures: Pictures,
    /// What the arm carries and what is tracked; empty without an arm.
    pub tip: &'static str,
    pub object: &'static str,
    /// What a success is called.
    pub success: &'static str,
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

/// The complete page.
pub fn render(data: &ReportData) -> String {
    page::html(data, &all_figures(data))
}

/// File stem of every figure, and its content where the data allows it.
pub fn figures(data: &ReportData) -> Vec<(&'static str, Option<String>)> {
    all_figures(data).iter().map(|figure| (figure.stem, figure.svg())).collect()
}

fn all_figures(data: &ReportData) -> Vec<Figure> {
    if let Some(plane) = data.plane() {
        return vec![plane::figure(data, plane), reward::figure(data)];
    }
    if data.is_action() {
        return vec![reward::figure(data), measures::figure(data), modes::figure(data)];
    }
    let [wakeup, tick] = timing::figures(&data.timing);
    let mut figures = vec![reward::figure(data)];
    if data.is_toss() {
        figures.extend([strip::figure(data), animation::figure(data)]);
    } else {
        figures.push(paths::figure(data));
    }
    figures.extend([
        modes::figure(data),
        attractors::figure(data),
        ellipsoids::figure(data),
        activations::figure(data),
        stiffness::figure(data),
        coordinates::figure(data),
        if data.is_toss() { outcomes::figure(data) } else { measures::figure(data) },
        wakeup,
        tick,
    ]);
    figures
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::measures::MAX_MEASURES;

    /// Every drawing and the page, with no number that is not one.
    fn render_all(data: &ReportData) -> String {
        let figures: String = figures(data).into_iter().filter_map(|(_, svg)| svg).collect();
        let page = render(data);
        for text in [&figures, &page] {
            assert!(!text.contains("NaN") && !text.contains("inf\"") && !text.contains("inf "));
        }
        page
    }

    #[test]
    fn a_complete_session_has_every_figure_and_no_reference_to_elsewhere() {
        let data = sample::session(100);
        let figures = figures(&data);
        assert_eq!(figures.len(), 12);
        let page = render_all(&data);
        for (stem, svg) in &figures {
            assert!(svg.is_some(), "{stem}");
            assert!(page.contains(&format!("<section id=\"{stem}\"")), "{stem}");
        }
        for part in ["Configuration in effect", "All rollouts in numbers", "class=\"verdict\""] {
            assert!(page.contains(part), "{part}");
        }
        assert!(page.len() < 3_000_000, "{} bytes", page.len());
        for bad in ["is missing", "http:", "https:", "src=", "href=", "url(", "@import", "<script"]
        {
            assert!(!page.contains(bad), "{bad}");
        }
    }

    #[test]
    fn a_task_without_an_arm_has_its_page() {
        let mut data = sample::session(30);
        let axis = |label| crate::draw::plot::Axis { label, min: -1.0, max: 1.0 };
        let (x, y) = (axis("a"), axis("b"));
        data.trials.iter_mut().for_each(|trial| trial.theta = trial.theta.rows(0, 2).into());
        for row in &mut data.modes {
            row.mode.mean = row.mode.mean.rows(0, 2).into();
            row.mode.covariance = row.mode.covariance.view((0, 0), (2, 2)).into();
        }
        let reward = Box::new(|theta: &nalgebra::Vector2<f64>| theta.norm());
        data.pictures = Pictures::Plane(Plane { x, y, reward, max: 1.0 });
        let page = render_all(&data);
        assert!(page.contains("id=\"solutions\"") && page.contains("Configuration in effect"));
        assert!(!page.contains("id=\"flip\""), "there is no arm");
    }

    #[test]
    fn a_task_without_pictures_shows_its_measures() {
        let mut data = sample::session(30);
        data.pictures = Pictures::Plain;
        let page = render_all(&data);
        assert!(page.contains("id=\"measures\"") && !page.contains("id=\"flip\""));
        assert!(page.contains("apex_m, m"), "a panel for each number");
    }

    /// What HTML leaves open: elements without an end.
    const VOID: [&str; 3] = ["meta", "input", "!DOCTYPE"];

    /// Asserts that every element ends, within the one it began in.
    fn assert_nested(text: &str) {
        let mut open: Vec<&str> = Vec::new();
        for tag in text.split('<').skip(1) {
            let (tag, _) = tag.split_once('>').expect("a tag ends");
            let name = tag.split([' ', '\n', '/']).find(|part| !part.is_empty()).unwrap_or("");
            if tag.starts_with('/') {
                assert_eq!(open.pop(), Some(name), "<{tag}>");
            } else if !tag.ends_with('/') && !VOID.contains(&name) {
                open.push(name);
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }

    #[test]
    fn elements_are_nested() {
        let data = sample::session(20);
        assert_nested(&render(&data));
        figures(&data)
            .iter()
            .filter_map(|(_, svg)| svg.as_ref())
            .for_each(|svg| assert_nested(svg));
    }

    #[test]
    #[should_panic(expected = "</p>")]
    fn the_nesting_check_can_fail() {
        assert_nested("<p><b>bold</p></b>");
    }

    #[test]
    fn says_what_is_missing_instead_of_failing() {
        let mut data = sample::session(0);
        (data.initial, data.learnt) = (PolicyMsg::EMPTY, PolicyMsg::EMPTY);
        data.initial_path.clear();
        data.learnt_path.clear();
        data.modes.clear();
        data.timing = Err("timing.json: it is damaged".into());
        let page = render_all(&data);
        assert_eq!(page.matches("is missing").count(), 12);
        assert!(page.contains("timing.json: it is damaged"));
        assert!(figures(&data).iter().all(|(_, svg)| svg.is_none()));
    }

    #[test]
    fn a_policy_of_systems_has_no_springs_to_draw() {
        let mut data = sample::session(5);
        data.learnt = PolicyMsg { n_components: 0, n_systems: 2, ..data.learnt };
        let page = render_all(&data);
        assert_eq!(page.matches("a policy of systems has no springs").count(), 4);
    }

    #[test]
    fn draws_a_session_of_one_rollout_without_success() {
        let mut data = sample::session(1);
        data.trials[0].success = false;
        data.trials[0].measures = Measures::NONE;
        data.learnt_measures = Measures::NONE;
        data.learnt_path.truncate(1);
        assert!(render_all(&data).contains("No caught flip"));
        data.initial = PolicyMsg::EMPTY;
        render_all(&data);
    }

    #[test]
    fn survives_values_that_are_not_finite() {
        let mut data = sample::session(5);
        data.trials[2].reward = f64::NAN;
        data.trials[3].measures.values = [f64::INFINITY; MAX_MEASURES];
        data.trials[4].measures.values = [f64::NAN; MAX_MEASURES];
        data.learnt.components[1].stiffness = [f64::NAN; shm_types::PACKED];
        data.learnt.components[2].attractor[0] = f64::INFINITY;
        data.learnt_path[7].pan_position[2] = f32::NAN;
        data.learnt_measures.values = [f64::NAN; MAX_MEASURES];
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
