//! Whole pages: complete, numbered without a gap, escaped, nested, and never without reason.

use super::*;
use shm_types::measures::MAX_MEASURES;

/// Every drawing and the page, with no number that is not one.
fn render_all(data: &ReportData) -> String {
    let figures = figures(data);
    let page = render(data, &figures);
    let figures: String = figures.iter().filter_map(Figure::svg).collect();
    for text in [&figures, &page] {
        assert!(!text.contains("NaN") && !text.contains("inf\"") && !text.contains("inf "));
    }
    page
}

#[test]
fn a_complete_session_has_every_figure_numbered_without_a_gap() {
    let data = sample::session(100);
    let figures = figures(&data);
    assert_eq!(figures.len(), 15);
    let page = render_all(&data);
    for (number, figure) in (1..).zip(&figures) {
        let stem = figure.stem;
        assert!(figure.svg().is_some(), "{stem}");
        assert!(page.contains(&format!("<section id=\"{stem}\"")), "{stem}");
        assert!(page.contains(&format!("<b>Figure {number}.</b>")), "{number}");
        assert!(page.contains(&format!("href=\"{stem}.svg\"")), "{stem}");
    }
    for part in ["Configuration in effect", "All rollouts in numbers", "class=\"verdict\""] {
        assert!(page.contains(part), "{part}");
    }
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
    for bad in ["Not shown", "http:", "https:", "src=", "url(", "@import", "<script"] {
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
const VOID: [&str; 4] = ["meta", "link", "input", "!DOCTYPE"];

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
    let figures = figures(&data);
    assert_nested(&render(&data, &figures));
    figures.iter().filter_map(Figure::svg).for_each(|svg| assert_nested(&svg));
}

#[test]
#[should_panic(expected = "</p>")]
fn the_nesting_check_can_fail() {
    assert_nested("<p><b>bold</p></b>");
}

#[test]
fn says_what_is_not_shown_instead_of_failing() {
    let mut data = sample::session(0);
    (data.initial, data.learnt) = (PolicyMsg::EMPTY, PolicyMsg::EMPTY);
    data.initial_path.clear();
    data.film.path.clear();
    data.modes.clear();
    data.terms.clear();
    data.robustness = Err("run `skillet report`".into());
    data.timing = Err("timing.json: it is damaged".into());
    let page = render_all(&data);
    assert!(page.contains("Not shown") && !page.contains("<b>Figure"));
    assert!(page.contains("timing.json: it is damaged"));
    assert!(figures(&data).iter().all(|figure| figure.svg().is_none()));
}

#[test]
fn a_policy_of_systems_has_no_springs_to_draw() {
    let mut data = sample::session(5);
    data.learnt = PolicyMsg { n_components: 0, n_systems: 2, ..data.learnt };
    let page = render_all(&data);
    assert_eq!(page.matches("a policy of systems has no springs").count(), 1);
    assert!(!page.contains("id=\"stiffness\"") && page.contains("id=\"motion\""));
}

#[test]
fn draws_a_session_of_one_rollout_without_success() {
    let mut data = sample::session(1);
    data.trials[0].success = false;
    data.trials[0].measures = Measures::NONE;
    data.learnt_measures = Measures::NONE;
    data.film.path.truncate(1);
    assert!(render_all(&data).contains("No caught flip"));
    data.initial = PolicyMsg::EMPTY;
    render_all(&data);
}

#[test]
fn what_a_judge_of_ones_own_calls_a_success_is_no_caught_flip() {
    let mut data = sample::session(20);
    data.success = Some("success");
    let page = render_all(&data);
    assert!(page.contains("no success") && !page.contains("caught flip</text>"));
    assert!(!page.contains("caught flips") && !page.contains("<th scope=\"col\">caught</th>"));
    data.success = None;
    assert!(!render_all(&data).contains("among the last 10, %"), "there is only a reward");
}

#[test]
fn survives_values_that_are_not_finite() {
    let mut data = sample::session(5);
    data.trials[2].reward = f64::NAN;
    data.trials[3].measures.values = [f64::INFINITY; MAX_MEASURES];
    data.trials[4].measures.values = [f64::NAN; MAX_MEASURES];
    data.learnt.components[1].stiffness = [f64::NAN; shm_types::PACKED];
    data.learnt.components[2].attractor[0] = f64::INFINITY;
    data.film.path[7].pan_position[2] = f32::NAN;
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
    let page = render_all(&data);
    for raw in ["<b>pancake", "a&b", "<script>", "<u>"] {
        assert!(!page.contains(raw), "{raw}");
    }
    assert!(page.contains("&lt;/pre&gt;&lt;script&gt;"));
}
