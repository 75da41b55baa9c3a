//! The built-in rewards, written as a user would write them: equal to the last bit.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shm_types::episode::{OUTCOME_SUCCESS, OUTCOME_TOSSED, OutcomeMsg};

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

fn values(outcome: &OutcomeMsg) -> [f64; 9] {
    [
        outcome.crossing_time_s,
        outcome.flip_angle_rad,
        outcome.distance_m,
        outcome.lateral_m,
        outcome.final_lateral_m,
        outcome.apex_m,
        outcome.bounce_s,
        outcome.clipped_share,
        f64::from(outcome.has(OUTCOME_SUCCESS)),
    ]
}

/// Around what a toss measures, beyond the clamps on both sides, and 0 now and then.
fn random_outcome(rng: &mut ChaCha8Rng) -> OutcomeMsg {
    let mut around = |scale: f64| match rng.next_u32() % 8 {
        0 => 0.0,
        1 => rng.random_range(-scale..0.0),
        _ => rng.random_range(0.0..2.0 * scale),
    };
    let mut outcome = OutcomeMsg {
        flags: OUTCOME_TOSSED,
        crossing_time_s: around(1.0),
        flip_angle_rad: around(3.0),
        distance_m: around(0.5),
        lateral_m: around(0.2),
        final_lateral_m: around(0.2),
        apex_m: around(0.5),
        bounce_s: around(0.1),
        clipped_share: around(0.2),
        ..OutcomeMsg::ZERO
    };
    if rng.random() {
        outcome.flags |= OUTCOME_SUCCESS;
    }
    outcome
}

#[test]
fn rewards_as_text_have_the_bits_of_the_built_in_ones() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for (kind, text) in [(RewardKind::Paper, PAPER), (RewardKind::Catch, CATCH)] {
        let built_in = RewardConfig { kind, ..RewardConfig::default() };
        let expression = Expression::parse(text, &MEASURES, Number).unwrap();
        for _ in 0..5000 {
            let outcome = random_outcome(&mut rng);
            let (expected, found) =
                (built_in.reward(&outcome), expression.number(&values(&outcome)));
            assert_eq!(found.map(f64::to_bits), Ok(expected.to_bits()), "{kind:?} {outcome:?}");
        }
    }
}
