//! A primitive of dmpbbo, played: the table of text that a recording of it would be.

use anyhow::{Context, Result, bail};
use imitation::dmpbbo::Dmpbbo;
use serde_json::Value;

/// Rows, at equal steps, of a primitive of any duration.
const N_ROWS: usize = 2000;
/// More coordinates than a pose or an arm has any use for.
const MAX_COORDINATES: usize = 32;

/// The table `t_s,x_m,…` of the primitive that `bytes` hold, or `None` where they hold no primitive of dmpbbo.
///
/// Coordinates are named by their number: 3 are x, y, z, 4 have a pitch besides, 6 roll and yaw too, and as many as the
/// arm has joints (`n_joints`) are these. With `is_mapped`, where `--columns` says what they are, they are y1, y2, …
pub fn table(file: &str, bytes: &[u8], n_joints: usize, is_mapped: bool) -> Result<Option<String>> {
    let Some(text) = primitive(bytes) else { return Ok(None) };
    let primitive = Dmpbbo::from_json(text).with_context(|| format!("{file}: a file of dmpbbo"))?;
    let names = names(file, primitive.dim(), n_joints, is_mapped)?;
    let period_s = primitive.duration_s() / (N_ROWS - 1) as f64;
    let path = primitive.rollout(primitive.duration_s(), period_s);
    if let Some(at) = path.iter().position(|x| !x.is_finite()) {
        let (row, coordinate) = (at / path.nrows(), at % path.nrows() + 1);
        bail!(
            "{file}: when integrated, coordinate {coordinate} is not finite at {:.3} s: check \
             _tau, spring_constant, damping_coefficient and mass of the primitive",
            row as f64 * period_s
        );
    }
    let mut table = format!("t_s,{}\n", names.join(","));
    for (row, x) in path.column_iter().enumerate() {
        table += &(row as f64 * period_s).to_string();
        x.iter().for_each(|x| table += &format!(",{x}"));
        table.push('\n');
    }
    Ok(Some(table))
}

/// The text of a JSON object that names a class, as both formats of dmpbbo do.
fn primitive(bytes: &[u8]) -> Option<&str> {
    let text = std::str::from_utf8(bytes).ok().filter(|text| text.trim_start().starts_with('{'))?;
    let value: Value = serde_json::from_str(text).ok()?;
    let is_one = value["class"].is_string() || value["py/object"].is_string();
    is_one.then_some(text)
}

fn names(file: &str, dim: usize, n_joints: usize, is_mapped: bool) -> Result<Vec<String>> {
    const POSE: [&str; 6] = ["x_m", "y_m", "z_m", "pitch_rad", "roll_rad", "yaw_rad"];
    let numbered = |letter: &str, unit: &str| -> Vec<String> {
        (1..=dim).map(|i| format!("{letter}{i}{unit}")).collect()
    };
    let (is_pose, is_joints) = ([3, 4, 6].contains(&dim), dim == n_joints);
    match (is_mapped, is_pose, is_joints) {
        (true, ..) if dim <= MAX_COORDINATES => Ok(numbered("y", "")),
        (false, true, false) => Ok(POSE[..dim].iter().map(|name| name.to_string()).collect()),
        (false, false, true) => Ok(numbered("q", "_rad")),
        (false, true, true) => bail!(
            "{file}: a primitive of {dim} coordinates; that number fits both a pose and the joints \
             of the arm: say which they are with --columns x=y1,y=y2,z=y3,… or q1=y1,q2=y2,…"
        ),
        _ => bail!(
            "{file}: a primitive of {dim} coordinates: without --columns, 3 are x, y, z, 4 have a pitch besides, 6 roll \
             and yaw too, and {n_joints} are the joints of the arm; else say which of y1 to y{dim} is what, of at most \
             {MAX_COORDINATES}, as in --columns x=y1,y=y2,z=y3"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PANCAKE: &str = include_str!("../../tests/vectors/dmpbbo_pancake.json");

    fn header(text: &str, n_joints: usize, is_mapped: bool) -> Result<String> {
        let table = table("p.json", text.as_bytes(), n_joints, is_mapped)?.expect("a primitive");
        Ok(table.lines().next().unwrap_or_default().to_string())
    }

    /// Against `integrate_step` of dmpbbo's Python package, in steps of 0.1 ms.
    #[test]
    fn a_primitive_goes_where_dmpbbo_moves_it() {
        let table = table("p.json", PANCAKE.as_bytes(), 7, false).unwrap().unwrap();
        let rows: Vec<Vec<f64>> = table
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
            .collect();
        assert_eq!((rows[0][0], rows[N_ROWS - 1][0]), (0.0, 1.4));
        for (t_s, expected) in [
            (0.5, [0.78, 0.0, 0.70062388, 0.06065928]),
            (0.9, [0.78, 0.0, 0.82162843, -0.50810954]),
            (1.2, [0.78, 0.0, 0.720056186, -0.000279108]),
        ] {
            let near = |row: &&Vec<f64>| (row[0] - t_s).abs() <= 0.5 * 1.4 / (N_ROWS - 1) as f64;
            let row = rows.iter().find(near).unwrap();
            for (found, expected) in row[1..].iter().zip(expected) {
                assert!((found - expected).abs() < 2e-3, "{row:?} at {t_s} s");
            }
        }
    }

    #[test]
    fn coordinates_are_named_by_their_number_or_by_the_user() {
        assert_eq!(header(PANCAKE, 7, false).unwrap(), "t_s,x_m,y_m,z_m,pitch_rad");
        assert_eq!(header(PANCAKE, 7, true).unwrap(), "t_s,y1,y2,y3,y4");
        let both = header(PANCAKE, 4, false).unwrap_err().to_string();
        assert!(both.contains("--columns x=y1"), "{both}");
        assert_eq!(names("p.json", 7, 7, false).unwrap()[6], "q7_rad");
        let neither = names("p.json", 5, 7, false).unwrap_err().to_string();
        assert!(neither.contains("5 coordinates") && neither.contains("y1 to y5"), "{neither}");
        assert!(names("p.json", 33, 7, true).unwrap_err().to_string().contains("at most 32"));
    }

    #[test]
    fn other_files_are_left_alone_and_bad_primitives_named_with_their_field() {
        for other in ["t_s,x_m\n", "{\"t\": [0, 1]}", "{", "", "[1, 2]"] {
            assert_eq!(table("p.json", other.as_bytes(), 7, false).unwrap(), None, "{other}");
        }
        for (from, to, words) in [
            ("\"_tau\":1.4,\"_dim_y\":4,\"_dim_x\":18", "\"_dim_y\":4", "missing field `_tau`"),
            ("\"mass\":1.0", "\"mass\":-1.0", "mass must be positive"),
            ("\"spring_constant\":100.0", "\"spring_constant\":1e300", "spring_constant"),
            ("\"class\":\"Dmp\"", "\"py/object\":\"dmpbbo.dmps.Dmp.Dmp\"", "savejson_for_cpp"),
            ("\"class\":\"Dmp\"", "\"class\":\"Trajectory\"", "a Trajectory is not supported"),
        ] {
            assert!(PANCAKE.contains(from), "{from}");
            let error = header(&PANCAKE.replacen(from, to, 1), 7, false).unwrap_err();
            let message = format!("{error:#}");
            assert!(message.starts_with("p.json: ") && message.contains(words), "{message}");
        }
    }
}
