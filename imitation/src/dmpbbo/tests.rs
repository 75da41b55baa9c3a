//! Small primitives in dmpbbo's format, against its equations integrated as they are printed there.

use serde_json::{Value, json};

use super::*;

/// Two coordinates, made up: as `savejson_for_cpp` lays them out.
fn file() -> Value {
    let approximator = |weights: [f64; 4]| {
        json!({
            "class": "FunctionApproximatorRBFN",
            "_meta_params": {"n_basis_functions_per_dim": [4], "intersection_height": 0.7, "regularization": 0.0},
            "_model_params": {
                "centers": [[0.0], [0.35], [0.7], [1.0]],
                "widths": [[0.2], [0.2], [0.2], [0.2]],
                "weights": weights.map(|w| [w]),
            },
            "_dim_input": 1,
            "_selected_param_names": null,
        })
    };
    json!({
        "class": "Dmp",
        "_tau": 0.8,
        "_dim_y": 2,
        "_dim_x": 8,
        "_x_init": [0.1, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        "_y_attr": [0.5, 0.3],
        "_function_approximators": [approximator([5.0, 40.0, -30.0, 3.0]), approximator([0.0, -25.0, 60.0, 1.0])],
        "_forcing_term_scaling": "NO_SCALING",
        "_scaling_amplitudes": [0.4, 0.6],
        "_spring_system": {
            "class": "SpringDamperSystem", "_tau": 0.8, "_dim_y": 2, "_dim_x": 4,
            "_x_init": [0.1, -0.2, 0.0, 0.0], "_y_attr": [0.5, 0.3],
            "damping_coefficient": 20.0, "mass": 1.0, "spring_constant": 100.0,
        },
        "_phase_system": {
            "class": "TimeSystem", "_count_down": false, "_tau": 0.8, "_dim_y": 1, "_dim_x": 1, "_x_init": [0.0],
        },
        "_gating_system": {
            "class": "SigmoidSystem", "_tau": 0.8, "_dim_y": 1, "_dim_x": 1, "_x_init": [1.0],
            "_max_rate": -15, "_inflection_ratio": 0.85, "_Ks_cached": [1.0000372],
        },
        "_goal_system": {
            "class": "ExponentialSystem", "_tau": 0.8, "_dim_y": 2, "_dim_x": 2,
            "_x_init": [0.1, -0.2], "_x_attr": [0.5, 0.3], "alpha": 15,
        },
        "_ts_train": [0.0, 0.4, 0.8],
        "_selected_param_names": [],
    })
}

fn read(file: &Value) -> Result<Dmpbbo, DmpbboError> {
    Dmpbbo::from_json(&file.to_string())
}

/// dmpbbo's own equations for the first coordinate of [`file`] with fine Euler steps: goal, gate and
/// springs as three systems of differential equations.
fn euler(file: &Value, scale: f64, duration_s: f64) -> f64 {
    let weights = [5.0, 40.0, -30.0, 3.0];
    let (tau, h) = (file["_tau"].as_f64().unwrap(), 1e-5);
    let r = -15.0;
    let ks = 1.0 + 1.0 / (-r * 0.85 * tau).exp();
    let (mut y, mut z, mut goal, mut gate) = (0.1, 0.0, 0.1, 1.0);
    for step in 0..(duration_s / h).round() as usize {
        let phase = (step as f64 * h / tau).min(1.0);
        let output: f64 = [0.0, 0.35, 0.7, 1.0]
            .iter()
            .zip(weights)
            .map(|(c, w): (&f64, f64)| w * (-0.5 * ((phase - c) / 0.2_f64).powi(2)).exp())
            .sum();
        let yd = z / tau;
        let zd = (100.0 * (goal - y) - 20.0 * z) / tau + gate * scale * output / tau;
        goal += h * 15.0 * (0.5 - goal) / tau;
        gate += h * r * gate * (1.0 - gate / ks);
        y += h * yd;
        z += h * zd;
    }
    y
}

#[test]
fn a_primitive_moves_as_dmpbbo_moves_it() {
    for (scaling, scale) in
        [("NO_SCALING", 1.0), ("AMPLITUDE_SCALING", 0.4), ("G_MINUS_Y0_SCALING", 0.4)]
    {
        let mut file = file();
        file["_forcing_term_scaling"] = scaling.into();
        let path = read(&file).unwrap().rollout(0.8, 0.001);
        for k in [100, 300, 500, 800] {
            let expected = euler(&file, scale, k as f64 * 0.001);
            assert!((path[(0, k)] - expected).abs() < 1e-4, "{scaling} at {k} ms");
        }
    }
}

#[test]
fn the_plain_form_comes_as_near_as_it_says() {
    let original = read(&file()).unwrap();
    let misses = [8, 30, 60].map(|k| {
        let Conversion { dmp, largest_miss } = original.plain(k, 0.6);
        let path = dmp.rollout(0.8, 0.002) - original.rollout(0.8, 0.002);
        assert!(path.amax() <= largest_miss * 1.01);
        // As attractors in the unit of Eq. (5): κᴾ/τ = k/τ².
        let attractors = dmp.attractors().attractors;
        assert!((attractors.K[0][(0, 0)] - 100.0 / 0.64).abs() < 1e-9);
        assert!((attractors.kappa_v - 20.0 / 0.8).abs() < 1e-12);
        largest_miss
    });
    assert!(misses[0] > misses[1] && misses[1] > misses[2], "{misses:?}");
    assert!(misses[1] < 2e-3, "{misses:?}");
}

#[test]
fn a_path_that_overflows_is_missed_by_infinity() {
    let mut file = file();
    file["_y_attr"] = json!([1e308, -1e308]);
    assert_eq!(read(&file).unwrap().plain(8, 0.6).largest_miss, f64::INFINITY);
}

#[test]
fn other_phases_and_locally_weighted_regression_are_read() {
    let mut file = file();
    file["_phase_system"] = json!({
        "class": "ExponentialSystem", "_tau": 0.8, "_x_init": [1.0], "_x_attr": [0.0], "alpha": [4.0],
    });
    file["_gating_system"] = file["_phase_system"].clone();
    file["_goal_system"] = Value::Null;
    file["_function_approximators"][0] = json!({
        "class": "FunctionApproximatorLWR",
        "_model_params": {
            "centers": [[0.0], [1.0]], "widths": [[0.3], [0.3]],
            "slopes": [[2.0], [-1.0]], "offsets": [[10.0], [20.0]],
        },
    });
    let dmpbbo = read(&file).unwrap();
    // At s = 0.5 both lines weigh the same: (2·0.5 + 10 − 0.5 + 20)/2 = 15.25.
    let t_s = 0.8 / 4.0 * 2_f64.ln();
    assert!((dmpbbo.force(t_s)[0] - 0.5 * 15.25 / 0.8).abs() < 1e-9);
    file["_function_approximators"] = Value::Null;
    assert_eq!(read(&file).unwrap().force(0.1).amax(), 0.0);
}

#[test]
fn what_is_not_supported_is_refused_by_its_name() {
    let refused = |change: &dyn Fn(&mut Value)| {
        let mut file = file();
        change(&mut file);
        read(&file).unwrap_err().to_string()
    };
    let richards = json!({"class": "RichardsSystem", "_tau": 0.8});
    for (change, word) in [
        (
            &(|f: &mut Value| f["_gating_system"] = richards.clone()) as &dyn Fn(&mut Value),
            "RichardsSystem",
        ),
        (&|f| f["class"] = "DmpWithSchedules".into(), "DmpWithSchedules"),
        (&|f| f["_damping_system"] = json!({"class": "ExponentialSystem"}), "_damping_system"),
        (&|f| f["_spring_system"]["mass"] = json!([1.0, 2.0]), "mass differs"),
        (&|f| f["_spring_system"]["mass"] = json!(0.0), "mass must be positive"),
        (&|f| f["_spring_system"]["_x_init"][2] = json!(0.3), "at rest"),
        (&|f| f["_forcing_term_scaling"] = "OTHER".into(), "OTHER"),
        (&|f| f["_y_attr"] = json!([0.5]), "_y_attr has 1 values"),
        (&|f| f["_dim_y"] = json!(u64::MAX), "_y_attr has 2 values"),
        (&|f| f["_dim_y"] = json!(0), "_dim_y must be positive"),
        (&|f| f["_tau"] = json!(5e-324), "_tau must be positive"),
        (&|f| f["_spring_system"]["mass"] = json!(1e-307), "relative to mass and _tau"),
        (&|f| f["_function_approximators"][1]["class"] = "FunctionApproximatorGPR".into(), "GPR"),
        (
            &|f| f["_function_approximators"][0]["_model_params"] = Value::Null,
            "not a readable dmpbbo Dmp",
        ),
        (
            &|f| f["_function_approximators"][0]["_model_params"]["widths"][1][0] = json!(0.0),
            "widths",
        ),
        (
            &|f| f["_function_approximators"][0]["_model_params"]["weights"] = json!([[1.0]]),
            "has 1 values",
        ),
        (&|f| f["_phase_system"] = Value::Null, "not a readable dmpbbo Dmp"),
        (&|f| f["py/object"] = "dmpbbo.dmps.Dmp.Dmp".into(), "savejson_for_cpp"),
    ] {
        let message = refused(change);
        assert!(message.contains(word), "{word}: {message}");
    }
    assert!(matches!(Dmpbbo::from_json("{"), Err(DmpbboError::Format(_))));
}
