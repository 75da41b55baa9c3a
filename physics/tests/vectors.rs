//! Dynamics and kinematics against Pinocchio and MuJoCo, which agree to 3e-13 on these vectors.
//!
//! `SKILLET_VECTORS` names another directory with a `wam_dynamics.json` of the same format.

// Monogram notation.
#![allow(non_snake_case)]

mod common;

use common::wam;
use nalgebra::Matrix3;
use physics::arm::{ArmModel, JointMatrix, JointVector, TipKinematics, dynamics};
use serde_json::Value;

const TOLERANCE: f64 = 1e-9;

/// Largest deviation seen, by quantity.
#[derive(Default)]
struct Deviations(std::collections::BTreeMap<String, f64>);

impl Deviations {
    fn add(&mut self, name: &str, ours: &[f64], theirs: &[f64]) {
        assert_eq!(ours.len(), theirs.len(), "{name} has another size");
        let worst = self.0.entry(name.into()).or_default();
        for (a, b) in ours.iter().zip(theirs) {
            let deviation = (a - b).abs();
            // Also false for NaN, which max would swallow.
            assert!(deviation <= TOLERANCE, "{name} deviates by {deviation:e}");
            *worst = worst.max(deviation);
        }
    }

    fn print(&self, set: &str) {
        for (name, worst) in &self.0 {
            println!("{set:9} {name:16} {worst:.1e}");
        }
    }
}

#[test]
fn bare_arm_agrees_with_reference() {
    check_set("bare", "wam7.urdf");
}

#[test]
fn arm_with_pan_agrees_with_reference() {
    check_set("with_pan", "wam7_pan.urdf");
}

fn check_set(set: &str, urdf: &str) {
    let vectors: Value = common::vectors("wam_dynamics.json");
    let cases = vectors[set].as_array().expect("the set is a list of cases");
    assert!(!cases.is_empty());

    let models = ["flange", "pan"].map(|tip| (tip, wam(urdf, tip)));
    let mut deviations = Deviations::default();
    for case in cases {
        check_dynamics(&models[1].1, case, &mut deviations);
        for (tip, model) in &models {
            if case.get(tip).is_some() {
                check_tip(model, tip, case, &mut deviations);
            }
        }
    }
    deviations.print(set);
}

fn check_dynamics(model: &ArmModel, case: &Value, deviations: &mut Deviations) {
    let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| joints(&case[key]));
    let tau = dynamics::rnea(model, &q, &qd, &qdd);
    deviations.add("tau", tau.as_slice(), &numbers(&case["tau"]));
    let gravity = dynamics::gravity_torque(model, &q);
    deviations.add("gravity", gravity.as_slice(), &numbers(&case["tau_gravity"]));
    let bias = dynamics::bias(model, &q, &qd);
    deviations.add("bias", bias.as_slice(), &numbers(&case["tau_bias"]));

    let M = dynamics::mass_matrix(model, &q);
    assert_eq!(M, M.transpose());
    deviations.add("M", &upper(&M), &numbers(&case["M_upper"]));
}

fn check_tip(model: &ArmModel, tip: &str, case: &Value, deviations: &mut Deviations) {
    let (q, qd) = (joints(&case["q"]), joints(&case["qd"]));
    let expected = &case[tip];
    let kinematics = TipKinematics::new(model, &q, &qd);
    let mut add = |name: &str, ours: &[f64]| {
        deviations.add(&format!("{tip} {name}"), ours, &numbers(&expected[name]));
    };
    add("p", kinematics.X_WP.translation.vector.as_slice());
    let R: Matrix3<f64> = kinematics.X_WP.rotation.to_rotation_matrix().into_inner();
    add("R", R.transpose().as_slice());
    add("J", kinematics.J.transpose().as_slice());
    add("Jdot_qd", kinematics.Jdot_qd.as_slice());
}

fn upper(M: &JointMatrix) -> Vec<f64> {
    (0..7).flat_map(|i| (i..7).map(move |j| (i, j))).map(|ij| M[ij]).collect()
}

fn joints(value: &Value) -> JointVector {
    JointVector::from_row_slice(&numbers(value))
}

/// All numbers in reading order, however deep the lists are nested.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().expect("a number")],
    }
}
