//! Headers that recorders write are understood; those that cannot be say what they lack.

use super::super::dialect::Table;
use super::*;

/// `header` above two rows in which every column grows.
fn find_with(header: &str, n_joints: usize, mapping: &str) -> Result<Columns> {
    let n = header.split(',').count();
    let row = |k: usize| (0..n).map(|c| format!("{}", k + c)).collect::<Vec<_>>().join(",");
    let text = format!("{header}\n{}\n{}\n", row(0), row(1));
    let table = Table::parse("r.csv", &text)?;
    let mapping: Vec<Assignment> = match mapping {
        "" => Vec::new(),
        text => text.split(',').map(|one| one.parse().unwrap()).collect(),
    };
    let fields = Fields::of("r.csv", &table, &mapping);
    let names: Vec<String> = (1..=n_joints).map(|i| format!("arm_{i}")).collect();
    Columns::find(&fields, &names, &mapping)
}

fn find(header: &str) -> Result<Columns> {
    find_with(header, 2, "")
}

/// Names of the columns of the time, then of the quantities.
fn found(header: &str, n_joints: usize, mapping: &str) -> (String, String) {
    let columns = find_with(header, n_joints, mapping).unwrap_or_else(|e| panic!("{header}: {e}"));
    let join = |all: Vec<&Column>| {
        all.iter().map(|column| column.name.as_str()).collect::<Vec<_>>().join(" ")
    };
    (join(columns.time.iter().collect()), join(columns.values()))
}

#[test]
fn finds_columns_in_any_order_with_their_units() {
    let columns = find("q2_deg,qd1_rad_s,t_ms,q1_rad").unwrap();
    assert_eq!((columns.time[0].index, columns.time[0].scale), (2, 1e-3));
    assert_eq!(columns.ignored, ["qd1_rad_s"]);
    let Quantities::Joints(joints) = columns.quantities else { panic!("joints") };
    assert_eq!((joints[0].index, joints[0].scale), (3, 1.0));
    assert!((joints[1].scale * 180.0 - std::f64::consts::PI).abs() < 1e-15);

    let columns = find("t_s,x_mm,y_mm,z_m,qw,qx,qy,qz").unwrap();
    let Quantities::Task(position, Orientation::Quaternion(_)) = columns.quantities else {
        panic!("a pose with a quaternion")
    };
    assert_eq!(position.map(|column| column.scale), [1e-3, 1e-3, 1.0]);
    assert!(columns.ignored.is_empty());
}

const FRANKA: &str = "time, success_rate, state.q[0], state.q[1],state.q_d[0],state.q_d[1],state.dq[0],\
     state.dq[1],state.tau_J[0],state.tau_J[1],cmd.q_d[0],cmd.q_d[1]";
const ROSTOPIC: &str = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,\
     field.pose.position.y,field.pose.position.z,field.pose.orientation.x,\
     field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w";
const UR: &str = "timestamp,target_q_0,target_q_1,actual_q_0,actual_q_1,actual_qd_0,actual_qd_1,\
     actual_TCP_pose_0,actual_TCP_pose_1,actual_TCP_pose_2,actual_TCP_pose_3,\
     actual_TCP_pose_4,actual_TCP_pose_5";

/// Header, joints of the arm, and the columns that must be found for time and quantities.
fn check(cases: &[(&str, usize, &str, &str)]) {
    for (header, n, time, values) in cases {
        assert_eq!(found(header, *n, ""), (time.to_string(), values.to_string()), "{header}");
    }
}

#[test]
fn knows_the_names_that_recorders_of_poses_write() {
    check(&[
        ("T_S,X_MM,Y_MM,Z_MM", 2, "T_S", "X_MM Y_MM Z_MM"),
        ("time/s,Q1 [deg],Q2 [deg]", 2, "time/s", "Q1 [deg] Q2 [deg]"),
        (
            "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []",
            2,
            "timestamp [ns]",
            "p_RS_R_x [m] p_RS_R_y [m] p_RS_R_z [m] q_RS_w [] q_RS_x [] q_RS_y [] q_RS_z []",
        ),
        ("# timestamp,tx,ty,tz,qx,qy,qz,qw", 2, "timestamp", "tx ty tz qw qx qy qz"),
        (
            ROSTOPIC,
            2,
            "field.header.stamp",
            "field.pose.position.x field.pose.position.y \
            field.pose.position.z field.pose.orientation.w field.pose.orientation.x \
            field.pose.orientation.y field.pose.orientation.z",
        ),
        (
            "__time,/joint_states/arm_1/position,/joint_states/arm_1/velocity,/joint_states/arm_2/position,\
          /joint_states/header/stamp",
            2,
            "__time",
            "/joint_states/arm_1/position /joint_states/arm_2/position",
        ),
        (
            "__time,/joint_states/position[0],/joint_states/position[1],/joint_states/velocity[0],\
          /joint_states/velocity[1]",
            2,
            "__time",
            "/joint_states/position[0] /joint_states/position[1]",
        ),
        (
            "__time,/tool/pose/orientation/w,/tool/pose/orientation/x,/tool/pose/orientation/y,\
          /tool/pose/orientation/z,/tool/pose/position/x,/tool/pose/position/y,/tool/pose/position/z",
            2,
            "__time",
            "/tool/pose/position/x /tool/pose/position/y /tool/pose/position/z \
         /tool/pose/orientation/w /tool/pose/orientation/x /tool/pose/orientation/y /tool/pose/orientation/z",
        ),
    ]);
}

#[test]
fn knows_the_names_that_recorders_of_joints_write() {
    check(&[
        (UR, 2, "timestamp", "actual_q_0 actual_q_1"),
        // Not the joints of this arm, but a pose.
        (
            UR,
            7,
            "timestamp",
            "actual_TCP_pose_0 actual_TCP_pose_1 actual_TCP_pose_2 actual_TCP_pose_4 \
            actual_TCP_pose_3 actual_TCP_pose_5",
        ),
        (FRANKA, 2, "time", "state.q[0] state.q[1]"),
        (
            "timestamp,frame_index,episode_index,observation.state_0,observation.state_1,action_0,action_1",
            2,
            "timestamp",
            "observation.state_0 observation.state_1",
        ),
        (
            "stamp.sec,stamp.nanosec,joint_1,joint_2",
            2,
            "stamp.sec stamp.nanosec",
            "joint_1 joint_2",
        ),
        ("time,q_des_1,q_des_2,q_meas_1,q_meas_2", 2, "time", "q_meas_1 q_meas_2"),
        (",time,J1,J2", 2, "time", "J1 J2"),
        ("Seconds,Joint1Position,Joint2Position", 2, "Seconds", "Joint1Position Joint2Position"),
    ]);
}

#[test]
fn knows_a_matrix_column_by_column() {
    let header = "time".to_string() + &(0..16).map(|i| format!(",O_T_EE[{i}]")).collect::<String>();
    let (_, values) = found(&header, 2, "");
    assert!(
        values.starts_with(
            "O_T_EE[12] O_T_EE[13] O_T_EE[14] O_T_EE[0] O_T_EE[1] O_T_EE[2] O_T_EE[4]"
        )
    );
}

#[test]
fn columns_says_what_no_name_does() {
    for (header, mapping, time, values) in [
        ("a,b,c", "t=a,q1=c,q2=b", "a", "c b"),
        ("a,b,c,d", "t_ms=1,x=2,y=3,z=4", "a", "b c d"),
        ("t_s,left,right", "q1_deg=right,q2_deg=left", "t_s", "right left"),
        ("t_s,q1,q2,x,y,z", "x=x,y=y,z=z", "t_s", "x y z"),
        ("t_s,q1,q2,x,y,z", "q1=q1", "t_s", "q1 q2"),
        ("stamp,time,x,y,z", "t=stamp", "stamp", "x y z"),
    ] {
        assert_eq!(found(header, 2, mapping), (time.into(), values.into()), "{header}");
    }
    let columns = find_with("t_s,a,b", 2, "q1_deg=a,q2=b").unwrap();
    assert!((columns.values()[0].scale * 180.0 - std::f64::consts::PI).abs() < 1e-15);
    for (header, mapping, words) in [
        ("t_s,a,b", "q1=c", ["`c`", "t_s, a, b"]),
        ("t_s,a,b", "q1=a", ["q2", "q2=NAME"]),
        ("t_s,a,b", "q3=a", ["q3", "2 joints"]),
        ("t_s,a,b,c", "x=a,q1=b", ["both joints", "keep one"]),
        ("t_s,a,b,c", "x=a,x=b", ["x twice", "once"]),
    ] {
        let message = find_with(header, 2, mapping).expect_err(header).to_string();
        words.iter().for_each(|word| assert!(message.contains(word), "no '{word}' in: {message}"));
    }
}

#[test]
fn refuses_each_bad_header_and_says_what_to_write() {
    for (header, words) in [
        ("stuff,x_m,y_m,z_m", ["has no time", "stuff, x_m, y_m, z_m"]),
        ("stuff,x_m,y_m,z_m", ["t_s (or t_ms", "--columns t="]),
        ("t_s,a,b", ["neither joints nor positions", "t_s,q1_rad,…,q2_rad"]),
        ("t_s,a,b", ["the columns are t_s, a, b", "recognised is the time, t_s"]),
        ("stuff,q1,q2", ["has no time", "recognised are q1, q2"]),
        ("t_s,x_m,z_m", ["has no y_m", "y_mm"]),
        ("t_s,x_m,x_mm,y_m,z_m", ["both x_m and x_mm", "keep one"]),
        ("t_s,t_ms,x_m,y_m,z_m", ["both t_s and t_ms", "keep one"]),
        ("t_s,q1_rad,q3_rad", ["q3_rad", "2 joints"]),
        ("t_s,q1_rad", ["has no q2_rad", "q2_deg"]),
        ("t_s,q1_rad,q2_rad,x_m,y_m,z_m", ["both joints", "remove"]),
        ("t_s,x_m,y_m,z_m,qw,qx", ["2 of the columns", "all four"]),
        ("t_s,x_m,y_m,z_m,qw,qx,qy,qz,pitch_rad", ["quaternion and pitch", "keep one"]),
        ("t_s,x [inch],y [inch],z [inch]", ["`inch`", "m, cm, mm"]),
        ("t_s,actual_q_0,actual_q_1,actual_q_2", ["actual_q_2", "2 joints"]),
        (
            "t,/a/position/x,/a/position/y,/a/position/z,/b/position/x,/b/position/y,/b/position/z",
            ["both /a/position/x and /b/position/x", "--columns x="],
        ),
    ] {
        let message = find(header).expect_err(header).to_string();
        for word in words.iter().chain(&["r.csv, line 1"]) {
            assert!(message.contains(word), "{header}: no '{word}' in: {message}");
        }
    }
    let message = find("0.0,1.0,2.0").unwrap_err().to_string();
    assert!(message.contains("there is no header") && message.contains("1 to 3"), "{message}");
}
