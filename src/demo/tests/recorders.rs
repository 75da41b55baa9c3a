//! Files of recorders, recordings from elsewhere, and what may be meant otherwise.

use super::*;

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

#[test]
fn units_and_names_may_stand_in_comments_and_dates_are_told() {
    let table =
        |heading: &str| format!("{heading}\n{}", rows(|k| format!("{},780,0,{}", 10 * k, 700 + k)));
    for heading in [
        "# t, x, y, z\n# ms, mm, mm, mm",
        "t,x,y,z\nms,mm,mm,mm",
        "Rate,100,Hz\nt,x,y,z\n[ms],[mm],[mm],[mm]",
    ] {
        let imported = imported(&table(heading), &AS_IT_IS);
        assert!((imported.poses[100][2] - 0.8).abs() < 1e-9, "{heading}");
    }
    let dates = table("time,x_mm,y_mm,z_mm").replace("\n500,", "\n2024-05-01T12:00:00,");
    let message = import("r.csv", &dates, &arm(), &AS_IT_IS).err().unwrap().to_string();
    assert!(message.contains("line 52") && message.contains("dates"), "{message}");
}
