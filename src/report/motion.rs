//! The selected rollout in motion: the first thing a reader sees.

use super::ReportData;
use super::ellipsoids::varies;
use super::stage::{SLOWER, moving};
use crate::draw::figure::{Figure, HALF, Row};

/// Largest height, px.
const HEIGHT: f64 = 400.0;

pub fn figure(data: &ReportData) -> Figure {
    let policy = Some(&data.learnt).filter(|policy| varies(policy));
    let panel = moving(data, &data.film, policy, (HALF, HEIGHT), "m");
    let rows = match panel {
        Some(panel) => Ok(vec![Row::Moving(vec![panel])]),
        None => Err(format!("the session holds no path of rollout {}.", data.learnt_rollout)),
    };
    let springs = match policy {
        Some(_) => {
            format!(" Around the {}: its stiffness at that moment; larger is stiffer.", data.tip)
        }
        None => String::new(),
    };
    Figure {
        stem: "motion",
        title: if data.is_toss() { "The flip" } else { "The movement" },
        caption: format!(
            "Rollout {} from the side, {SLOWER:.0} times slower. Dotted: path of the {}.{springs}{}",
            data.learnt_rollout,
            data.followed(),
            links(data)
        ),
        rows,
    }
}

/// Where the shape and the posture of the arm come from.
fn links(data: &ReportData) -> String {
    let Some(look) = data.look.as_ref().filter(|_| !data.film.arm.is_empty()) else {
        return String::new();
    };
    let shape = match look.has_shapes {
        true => " Links: shapes of the URDF",
        false => " Links run from joint to joint of the URDF, as thick as their inertia says",
    };
    let posture = match look.is_measured {
        true => ".",
        false => {
            "; their posture follows from the path of the tip, as the joints of this rollout \
                  are not stored."
        }
    };
    format!("{shape}{posture}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn moves_without_a_script_and_not_on_paper() {
        let html = figure(&sample::session(5)).html(1);
        assert!(!html.contains("<script") && html.contains("prefers-reduced-motion"));
        assert!(html.contains("@media screen{.m"));
        assert!(html.contains("type=\"checkbox\"") && html.contains("Pause"));
    }

    #[test]
    fn the_arm_is_drawn_where_there_is_one() {
        let mut data = sample::session(5);
        assert!(figure(&data).svg().unwrap().contains("class=\"link\""));
        data.film.arm.clear();
        let figure = figure(&data);
        assert!(!figure.svg().unwrap().contains("class=\"link\""));
        assert!(!figure.caption.contains("URDF"));
    }

    #[test]
    fn a_path_of_one_moment_does_not_move() {
        let mut data = sample::session(5);
        data.film.path = vec![data.film.path[0]; 9];
        assert!(figure(&data).rows.is_err());
        data.film.path.truncate(1);
        assert!(figure(&data).rows.is_err());
    }
}
