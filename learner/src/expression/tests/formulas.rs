//! The built-in rewards, written as a user would write them: equal to the last bit.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shm_types::measures::{Measure, Measures, TRUTH};

use super::super::Expression;
use super::super::Kind::{self, Number, Truth};
use crate::reward::{RewardConfig, RewardKind};

const MEASURES: [(&str, Kind); 9] = [
    ("crossing_time_s", Number),
    ("flip_angle_rad", Number),
    ("distance_m", Number),
    ("lateral_m", Number),
    ("final_lateral_m", Number),
    ("apex_m", Number),
    ("bounce_s", Number),
    ("clipped_share", Number),
    ("caught", Truth),
];

const PAPER: &str = "
    if(crossing_time_s > 0,
       0.5*(clamp(flip_angle_rad, 0, pi)/pi) + 0.5*exp(-max(distance_m, 0)), 0)
    + 0.5*max(apex_m, 0)";

const CATCH: &str = "
    1.5*clamp(apex_m, 0, 0.55)
    + if(crossing_time_s > 0, clamp(flip_angle_rad, 0, pi)/pi, 0)
    + if(crossing_time_s > 0, exp(-max(lateral_m, 0)/0.1), 0)
    + if(caught, exp(-max(final_lateral_m, 0)/0.1), 0)
    + if(caught, 0.5*exp(-max(bounce_s, 0)/0.05), 0)
    + if(caught, 0.5*exp(-max(clipped_share, 0)/0.05), 0)";

/// Around what a toss measures, beyond the clamps on both sides, and 0 now and then.
fn random_values(rng: &mut ChaCha8Rng) -> [f64; 9] {
    let scales = [1.0, 3.0, 0.5, 0.2, 0.2, 0.5, 0.1, 0.2];
    let mut values = [0.0; 9];
    for (value, scale) in values.iter_mut().zip(scales) {
        *value = match rng.next_u32() % 8 {
            0 => 0.0,
            1 => rng.random_range(-scale..0.0),
            _ => rng.random_range(0.0..2.0 * scale),
        };
    }
    values[8] = f64::from(rng.random::<bool>());
    values
}

fn measures(values: &[f64; 9]) -> Measures {
    let unit = |kind| if kind == Truth { TRUTH } else { "1" };
    let measure = |((name, kind), value)| Measure { name, unit: unit(kind), value };
    Measures::of(MEASURES.into_iter().zip(*values).map(measure)).unwrap()
}

#[test]
fn rewards_as_text_have_the_bits_of_the_built_in_ones() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for (kind, text) in [(RewardKind::Paper, PAPER), (RewardKind::Catch, CATCH)] {
        let built_in = RewardConfig { kind, ..RewardConfig::default() };
        let expression = Expression::parse(text, &MEASURES, Number).unwrap();
        for _ in 0..5000 {
            let values = random_values(&mut rng);
            let expected = built_in.reward(&measures(&values)).to_bits();
            let found = expression.number(&values).map(f64::to_bits);
            assert_eq!(found, Ok(expected), "{kind:?} {values:?}");
        }
    }
}
