//! However a recording is written down, it imports to the same demonstration.

use std::fmt::Write;

use super::*;

/// How one file is written.
#[derive(Clone, Copy, Debug)]
struct Style {
    separator: &'static str,
    decimal_comma: bool,
    quoted: bool,
    upper: bool,
    trailing: bool,
    line_end: &'static str,
    encoding: &'static str,
    comment: &'static str,
    /// Where units stand: `_u`, ` [u]`, ` (u)`, `/u`, a row below, or nowhere.
    units: usize,
    /// Name and size of the unit, s.
    time: (&'static str, f64),
    length: (&'static str, f64),
    angle: (&'static str, f64),
    epoch: bool,
    quaternion: bool,
    time_name: &'static str,
    /// Every so many rows: an empty one, a row without values, one that repeats the last time.
    extra_rows: usize,
}

fn pick<T: Copy>(random: &mut ChaCha8Rng, from: &[T]) -> T {
    from[random.random_range(0..from.len())]
}

impl Style {
    fn random(random: &mut ChaCha8Rng) -> Style {
        let separator = pick(random, &[",", ", ", ";", "\t", "|", " ", "   "]);
        let decimal_comma = random.random_bool(0.5);
        let units = random.random_range(0..6);
        let si = units == 5;
        Style {
            separator,
            decimal_comma,
            quoted: random.random_bool(0.2) || (decimal_comma && separator.starts_with(',')),
            upper: random.random_bool(0.3),
            trailing: random.random_bool(0.2) && !separator.starts_with(' '),
            line_end: pick(random, &["\n", "\r\n", "\r"]),
            encoding: pick(random, &["utf-8", "bom", "utf-16le", "utf-16be", "utf-16", "latin-1"]),
            comment: pick(random, &["", "# by hand; 2024, µ", "// a | b", "% c"]),
            units,
            time: pick(
                random,
                &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6), ("ns", 1e-9)],
            ),
            length: if si {
                ("m", 1.0)
            } else {
                pick(random, &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3)])
            },
            angle: match si {
                true => ("rad", 1.0),
                false => pick(random, &[("rad", 1.0), ("deg", PI / 180.0), ("°", PI / 180.0)]),
            },
            epoch: random.random_bool(0.5),
            quaternion: random.random_bool(0.5),
            time_name: pick(random, &["t", "time", "timestamp", "Stamp"]),
            extra_rows: pick(random, &[0, 3, 10]),
        }
    }

    fn line(&self, cells: &[String]) -> String {
        let quote = |cell: &String| if self.quoted { format!("\"{cell}\"") } else { cell.clone() };
        let cells: Vec<String> = cells.iter().map(quote).collect();
        let end = if self.trailing { self.separator.trim_end_matches(' ') } else { "" };
        format!("{}{end}{}", cells.join(self.separator), self.line_end)
    }

    fn number(&self, value: String) -> String {
        if self.decimal_comma { value.replace('.', ",") } else { value }
    }

    fn name(&self, name: &str, unit: &str) -> String {
        let text = match self.units {
            _ if unit.is_empty() => name.to_string(),
            0 => format!("{name}_{unit}"),
            1 => format!("{name} [{unit}]"),
            2 => format!("{name} ({unit})"),
            3 => format!("{name}/{unit}"),
            _ => name.to_string(),
        };
        if self.upper { text.to_uppercase() } else { text }
    }

    /// The built-in demonstration, as text.
    fn text(&self) -> String {
        let columns = [
            (self.time_name, self.time.0),
            ("x", self.length.0),
            ("y", self.length.0),
            ("z", self.length.0),
        ];
        let turns: &[(&str, &str)] = match self.quaternion {
            true => &[("qw", ""), ("qx", ""), ("qy", ""), ("qz", "")],
            false => &[("pitch", self.angle.0)],
        };
        let columns: Vec<(&str, &str)> = columns.iter().chain(turns).copied().collect();
        let mut text = String::new();
        if !self.comment.is_empty() {
            write!(text, "{}{}{}", self.comment, self.line_end, self.line_end).unwrap();
        }
        text += &self
            .line(&columns.iter().map(|(name, unit)| self.name(name, unit)).collect::<Vec<_>>());
        if self.units == 4 {
            let unit = |(_, unit): &(&str, &str)| {
                if unit.is_empty() { "-".into() } else { (*unit).into() }
            };
            text += &self.line(&columns.iter().map(unit).collect::<Vec<String>>());
        }
        for (k, pose) in built_in().poses().iter().enumerate() {
            let ticks = (10_000_000 * k as i64) / (self.time.1 * 1e9).round() as i64;
            let since = if self.epoch { (1_732_800_000.0 / self.time.1) as i64 } else { 0 };
            let stamp = match self.time.0 {
                "s" => format!("{:.6}", since as f64 + 0.01 * k as f64),
                _ => format!("{}", since + ticks),
            };
            let mut values =
                vec![pose[0] / self.length.1, pose[1] / self.length.1, pose[2] / self.length.1];
            match self.quaternion {
                true => values.extend([(0.5 * pose[3]).cos(), 0.0, (0.5 * pose[3]).sin(), 0.0]),
                false => values.push(pose[3] / self.angle.1),
            }
            let mut row = vec![self.number(stamp.clone())];
            row.extend(values.iter().map(|value| self.number(format!("{value:.9}"))));
            text += &self.line(&row);
            if self.extra_rows > 0 && k % self.extra_rows == 0 {
                text += &self.line(&row);
                text += self.line_end;
                let none = if self.separator.starts_with(' ') { "nan" } else { "" };
                let mut empty = vec![none.to_string(); row.len()];
                empty[0] = self.number(stamp);
                text += &self.line(&empty);
            }
        }
        text
    }

    fn bytes(&self) -> Vec<u8> {
        let text = self.text();
        let units = || text.encode_utf16();
        match self.encoding {
            "bom" => format!("\u{feff}{text}").into_bytes(),
            "utf-16le" => units().flat_map(u16::to_le_bytes).collect(),
            "utf-16be" => units().flat_map(u16::to_be_bytes).collect(),
            "utf-16" => {
                [&b"\xff\xfe"[..], &units().flat_map(u16::to_le_bytes).collect::<Vec<_>>()].concat()
            }
            // A capital µ is not in it.
            "latin-1" => text.replace('Μ', "µ").chars().map(|c| c as u8).collect(),
            _ => text.into_bytes(),
        }
    }
}

#[test]
fn any_combination_of_dialect_unit_and_stamp_is_the_same_demonstration() {
    let (arm, mut random) = (arm(), ChaCha8Rng::seed_from_u64(25));
    for _ in 0..1500 {
        let style = Style::random(&mut random);
        let bytes = style.bytes();
        let fail = |error: String| -> ! {
            let text = String::from_utf8_lossy(&bytes);
            panic!("{error}\n{style:?}\n{}", text.chars().take(600).collect::<String>())
        };
        let imported = super::super::import("r.csv", &bytes, &arm, &AS_IT_IS);
        let imported = imported.unwrap_or_else(|error| fail(format!("{error:#}")));
        if imported.poses.len() != built_in().poses().len() {
            fail(format!("{} samples", imported.poses.len()));
        }
        let deviation = deviation(&imported.poses, 0, 6);
        if deviation > 2e-6 {
            fail(format!("deviates by {deviation}"));
        }
    }
}

/// `rows` of 0 to 1 s, `row(t)` each.
fn rows(row: impl Fn(usize) -> String) -> String {
    (0..=100).map(|k| format!("{}\n", row(k))).collect()
}

fn imported(text: &str, options: &Options) -> Imported {
    import("r.csv", text, &arm(), options)
        .unwrap_or_else(|error| panic!("{error:#}\n{}", &text[..300]))
}

#[test]
fn files_of_known_recorders_are_read_without_a_word() {
    let stamp = |k: usize| 1_732_800_000_000_000_000 + 10_000_000 * k as u64;
    let z = |k: usize| 0.7 + 0.001 * k as f64;
    let tum = rows(|k| format!("{:.6} 0.78 0.0 {} 0 0 0 1", 1e9 + 0.01 * k as f64, z(k)));
    let rostopic =
        rows(|k| format!("{},{k},{},base,0.78,0,{},0,0,0,1", stamp(k) + 77_000, stamp(k), z(k)));
    let euroc = rows(|k| format!("{},0.78,0,{},1,0,0,0", stamp(k), z(k)));
    let ur = rows(|k| format!("{} 0.78 0 {} 0.0 0.0 0.0", 812.4 + 0.01 * k as f64, z(k)));
    let franka = rows(|k| format!("{}, 1.0, 1,0,0,0,0,1,0,0,0,0,1,0,0.78,0,{},1", 10 * k, z(k)));
    let matrix: Vec<String> = (0..16).map(|i| format!("O_T_EE[{i}]")).collect();
    let plot = rows(|k| {
        let other = format!("{:.6},,,,9.5", 1e9 + 0.01 * k as f64 + 0.004);
        format!("{:.6},0.78,0.0,{},\n{other}", 1e9 + 0.01 * k as f64, z(k))
    });
    let lists = rows(|k| format!("{},\"[0.78, 0.0, {}, 0, 0, 0, 1]\",5", 0.01 * k as f64, z(k)));
    for (text, recorder) in [
        (format!("# ground truth\n# timestamp tx ty tz qx qy qz qw\n{tum}"), "unknown"),
        (tum, "TUM trajectory"),
        (
            format!(
                "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,field.pose.position.y,field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w\n{rostopic}"
            ),
            "rostopic echo -p",
        ),
        (
            format!(
                "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n{euroc}"
            ),
            "unknown",
        ),
        (
            format!(
                "timestamp actual_TCP_pose_0 actual_TCP_pose_1 actual_TCP_pose_2 actual_TCP_pose_3 actual_TCP_pose_4 actual_TCP_pose_5\n{ur}"
            ),
            "UR RTDE",
        ),
        (format!("time, success_rate, {}\n{franka}", matrix.join(", ")), "libfranka"),
        (
            format!(
                "__time,/tool/pose/position/x,/tool/pose/position/y,/tool/pose/position/z,/wrench/force/z\n{plot}"
            ),
            "PlotJuggler",
        ),
    ] {
        let imported = imported(&text, &AS_IT_IS);
        assert_eq!(imported.format[0].1, recorder);
        assert_eq!(imported.poses.len(), 101, "{recorder}");
        for (k, pose) in imported.poses.iter().enumerate() {
            let expected = [0.78, 0.0, z(k), 0.0, 0.0, 0.0];
            (0..6).for_each(|c| {
                assert!((pose[c] - expected[c]).abs() < 1e-6, "{recorder}: {pose:?}")
            });
        }
        assert!(imported.warnings.is_empty(), "{recorder}: {:?}", imported.warnings);
    }
    let mapping = ["x=observation.state[0]", "y=observation.state[1]", "z=observation.state[2]"];
    let columns = mapping.iter().map(|one| one.parse().unwrap()).collect();
    let lists = imported(
        &format!("timestamp,observation.state,action\n{lists}"),
        &Options { columns, ..AS_IT_IS },
    );
    assert!((lists.poses[100][2] - 0.8).abs() < 1e-9);
}

#[test]
fn a_joint_state_is_put_in_the_order_of_the_arm() {
    let arm = arm();
    let names: Vec<&String> = arm.joint_names().iter().rev().collect();
    let q = |i: usize, k: usize| WAM7_START_POSTURE[6 - i] + 0.0005 * k as f64;
    let mut header = "%time,field.header.seq".to_string();
    (0..7).for_each(|i| header += &format!(",field.name{i}"));
    (0..7).for_each(|i| header += &format!(",field.position{i},field.velocity{i}"));
    let row = |k: usize| {
        let mut row = format!("{},{k}", 1_732_800_000_000_000_000 + 10_000_000 * k as u64);
        names.iter().for_each(|name| row += &format!(",{name}"));
        (0..7).for_each(|i| row += &format!(",{:.6},0.5", q(i, k)));
        row
    };
    let recorded = imported(&format!("{header}\n{}", rows(row)), &AS_IT_IS);
    let plain: String = (0..=100)
        .map(|k| {
            let values: Vec<String> = (0..7).rev().map(|i| format!("{:.6}", q(i, k))).collect();
            format!("{:.2},{}\n", 0.01 * k as f64, values.join(","))
        })
        .collect();
    let header = "t_s,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad,q7_rad";
    let plain = imported(&format!("{header}\n{plain}"), &AS_IT_IS);
    for (a, b) in recorded.poses.iter().zip(&plain.poses) {
        (0..6).for_each(|c| assert!((a[c] - b[c]).abs() < 1e-6));
    }
    let strange = format!(
        "{},field.name0\n{}",
        "%time,field.position0,field.position1,field.position2,field.position3,field.position4,field.position5,field.position6",
        rows(|k| format!("{},0,0,0,0,0,0,0,gripper", 10 * k))
    );
    let message = import("r.csv", &strange, &arm, &AS_IT_IS).err().unwrap().to_string();
    assert!(
        message.contains("gripper") && message.contains("--columns q1=field.position0"),
        "{message}"
    );
}

#[test]
fn a_demonstration_from_elsewhere_begins_at_the_start_and_may_be_slower() {
    let text = format!(
        "t_s,x_m,y_m,z_m,qx,qy,qz,qw\n{}",
        // Pointing down: turned by π about x.
        rows(|k| format!("{},4.0,1.0,{},1,0,0,0", 7.0 + 0.01 * k as f64, 0.7 + 0.001 * k as f64))
    );
    let message = import("r.csv", &text, &arm(), &AS_IT_IS).err().unwrap().to_string();
    assert!(message.contains("line 2") && message.contains("--at-start"), "{message}");
    let start = physics::arm::kinematics::tip_pose(&arm(), &WAM7_START_POSTURE);
    let moved = Options { at_start: Some(start), slow: 2.0, start_s: Some(0.5), ..AS_IT_IS };
    let imported = imported(&text, &moved);
    assert_eq!(imported.poses.len(), 101, "half of it, twice as slow");
    let [x, y, z, pitch, roll, yaw] = imported.poses[0];
    assert!((Vector3::new(x, y, z) - start.translation.vector).norm() < 1e-9);
    assert!(Vector3::new(pitch, roll, yaw).norm() < 1e-6);
    assert!((imported.poses[100][2] - z - 0.05).abs() < 1e-9);
}

#[test]
fn what_may_be_meant_otherwise_is_said() {
    let euler = format!(
        "t,x,y,z,roll,pitch,yaw\n{}",
        rows(|k| format!("{},0,0,0,0.5,0.5,0.5", 0.01 * k as f64))
    );
    assert!(imported(&euler, &AS_IT_IS).warnings[0].contains("Euler"));
    let far = format!("t,x,y,z\n{}", rows(|k| format!("{},780,0,720", 0.01 * k as f64)));
    let message = import("r.csv", &far, &arm(), &AS_IT_IS).err().unwrap().to_string();
    assert!(message.contains("--columns x_mm=NAME"), "{message}");
    let degrees = format!(
        "t,q1,q2,q3,q4,q5,q6,q7\n{}",
        rows(|k| format!("{},0,45,0,0,0,0,0", 0.01 * k as f64))
    );
    let message = import("r.csv", &degrees, &arm(), &AS_IT_IS).err().unwrap().to_string();
    assert!(message.contains("--columns q2_deg=NAME"), "{message}");
    let takes = format!("t,x,y,z\n{0}{0}", rows(|k| format!("{},0,0,0", 0.01 * k as f64)));
    let message = import("r.csv", &takes, &arm(), &AS_IT_IS).err().unwrap().to_string();
    assert!(message.contains("line 103") && message.contains("several takes"), "{message}");
    let gap = format!(
        "t,x,y,z\n{}",
        rows(|k| match k {
            40 => "0.4,,0,0".into(),
            41 => "0.41,nan,0,0".into(),
            _ => format!("{},{},0,0", 0.01 * k as f64, 0.001 * k as f64),
        })
    );
    let gap = imported(&gap, &AS_IT_IS);
    assert!(
        gap.warnings[0].contains("2 cells") && gap.warnings[0].contains("line 42"),
        "{:?}",
        gap.warnings
    );
    assert!((gap.poses[40][0] - 0.04).abs() < 1e-9);
}
