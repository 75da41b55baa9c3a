//! The posture that the null space is pulled to while a policy acts: the start posture, plus the operator's
//! offset.

use nalgebra::ArrayStorage;
use physics::arm::{JointVector, MAX_JOINTS};

const ZERO: JointVector = JointVector::from_array_storage(ArrayStorage([[0.0; MAX_JOINTS]]));

/// The fastest that a joint of the posture is on its way from rest, rad/s.
pub const SPEED_MAX: f64 = 1.0;

/// How long a way of so many radians takes at least, s: a movement of minimum jerk is at most 15/8 as fast
/// as its mean.
pub fn shortest_s(way_rad: f64) -> f64 {
    way_rad.abs() * 15.0 / 8.0 / SPEED_MAX
}

/// An admitted move: to `offset` from the start posture, rad, within `duration_s` > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostureMove {
    pub offset: JointVector,
    pub duration_s: f64,
}

impl PostureMove {
    /// To the start posture, where nobody has moved anything.
    pub const NONE: PostureMove = PostureMove { offset: ZERO, duration_s: 1.0 };

    /// It leads to the start posture.
    pub fn is_none(&self) -> bool {
        self.offset == ZERO
    }
}

/// The offset at a time, rad, and its derivatives, rad/s and rad/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    pub q: JointVector,
    pub qd: JointVector,
    pub qdd: JointVector,
}

impl Offset {
    const NONE: Offset = Offset { q: ZERO, qd: ZERO, qdd: ZERO };
}

/// The way of the offset in a rollout. It begins at the start posture; a move that is ordered on the way
/// leads on from there without a jump in position, speed or acceleration.
#[derive(Clone, Copy)]
pub struct PosturePath {
    from: Offset,
    to: PostureMove,
    /// Time of the rollout at which it left `from`, and how long it takes from there, s.
    left_s: f64,
    takes_s: f64,
}

impl PosturePath {
    pub const NONE: PosturePath = PosturePath {
        from: Offset::NONE,
        to: PostureMove::NONE,
        left_s: 0.0,
        takes_s: PostureMove::NONE.duration_s,
    };

    /// A rollout begins, at the start posture, and moves where the last order said.
    pub fn restart(&mut self) {
        (self.from, self.left_s, self.takes_s) = (Offset::NONE, 0.0, self.to.duration_s);
    }

    /// Moves on from where it is at `t_s`: as slowly as ordered, or as the way from there needs.
    pub fn go(&mut self, to: &PostureMove, t_s: f64) {
        self.from = self.at(t_s).unwrap_or(Offset::NONE);
        (self.to, self.left_s) = (*to, t_s);
        self.takes_s = to.duration_s.max(shortest_s((to.offset - self.from.q).amax()));
    }

    /// The offset at `t_s`; `None` at the start posture, where nothing is to be added.
    ///
    /// The polynomial of fifth order in s = (t − t₀)/T that meets both ends. From rest it is the movement of
    /// minimum jerk, q₀ + (q₁ − q₀)(10s³ − 15s⁴ + 6s⁵).
    pub fn at(&self, t_s: f64) -> Option<Offset> {
        let (T, to) = (self.takes_s, self.to.offset);
        let s = (t_s - self.left_s) / T;
        if s >= 1.0 {
            return (!self.to.is_none()).then_some(Offset { q: to, ..Offset::NONE });
        }
        if self.from == Offset::NONE && self.to.is_none() {
            return None;
        }
        let (q, v, a) = (self.from.q, self.from.qd * T, self.from.qdd * (T * T));
        let way = to - q;
        let c3 = way * 10.0 - v * 6.0 - a * 1.5;
        let c4 = way * -15.0 + v * 8.0 + a * 1.5;
        let c5 = way * 6.0 - v * 3.0 - a * 0.5;
        let (s2, s3) = (s * s, s * s * s);
        Some(Offset {
            q: q + v * s + a * (0.5 * s2) + c3 * s3 + c4 * (s3 * s) + c5 * (s3 * s2),
            qd: (v + a * s + c3 * (3.0 * s2) + c4 * (4.0 * s3) + c5 * (5.0 * s3 * s)) / T,
            qdd: (a + c3 * (6.0 * s) + c4 * (12.0 * s2) + c5 * (20.0 * s3)) / (T * T),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn to(offset: f64, duration_s: f64) -> PostureMove {
        PostureMove { offset: JointVector::repeat(offset), duration_s }
    }

    #[test]
    fn a_move_from_rest_has_minimum_jerk_and_ends_where_it_should() {
        let mut path = PosturePath::NONE;
        assert_eq!(path.at(0.3), None);
        path.go(&to(0.5, 2.0), 0.3);
        assert_eq!(path.at(0.3), Some(Offset::NONE), "no jump");
        let middle = path.at(1.3).unwrap();
        assert!((middle.q[0] - 0.25).abs() < 1e-12);
        assert!((middle.qd[0] - 15.0 / 8.0 * 0.5 / 2.0).abs() < 1e-12, "the fastest");
        assert_eq!(path.at(2.4), Some(Offset { q: to(0.5, 2.0).offset, ..Offset::NONE }));
    }

    #[test]
    fn an_order_on_the_way_leads_on_without_a_jump() {
        let mut path = PosturePath::NONE;
        path.go(&to(0.5, 1.0), 0.0);
        let before = path.at(0.4).unwrap();
        path.go(&to(-0.2, 0.8), 0.4);
        let after = path.at(0.4).unwrap();
        for (a, b) in [(before.q, after.q), (before.qd, after.qd), (before.qdd, after.qdd)] {
            assert!((a - b).amax() < 1e-12);
        }
        // The derivatives are those of the position, and it arrives at rest.
        let h = 1e-5;
        for t_s in [0.5, 0.8, 1.1] {
            let [last, now, next] = [t_s - h, t_s, t_s + h].map(|t_s| path.at(t_s).unwrap());
            assert!((now.qd - (next.q - last.q) / (2.0 * h)).amax() < 1e-7);
            assert!((now.qdd - (next.qd - last.qd) / (2.0 * h)).amax() < 1e-6);
        }
        let last = path.at(1.2 - 1e-9).unwrap();
        assert!((last.q[0] + 0.2).abs() < 1e-12 && last.qd[0].abs() < 1e-7);
    }

    #[test]
    fn an_order_that_is_too_fast_for_the_way_left_takes_longer() {
        let mut path = PosturePath::NONE;
        path.go(&to(0.8, 2.0), 0.0);
        path.go(&to(0.0, 0.25), 5.0);
        let fastest = (0..2000).filter_map(|k| path.at(5.0 + 1e-3 * f64::from(k)));
        let fastest = fastest.map(|offset| offset.qd.amax()).fold(0.0, f64::max);
        assert!((fastest - SPEED_MAX).abs() < 1e-6, "{fastest} rad/s");
    }

    #[test]
    fn back_at_the_start_posture_nothing_is_added_and_a_rollout_begins_there() {
        let mut path = PosturePath::NONE;
        path.go(&to(0.5, 1.0), 0.0);
        path.go(&to(0.0, 1.0), 3.0);
        assert!(path.at(3.5).is_some());
        assert_eq!(path.at(4.0), None);
        path.go(&to(0.5, 1.0), 5.0);
        path.restart();
        assert_eq!(path.at(0.0), Some(Offset::NONE));
        assert!((path.at(0.5).unwrap().q[0] - 0.25).abs() < 1e-12);
        path.go(&PostureMove::NONE, 0.0);
        assert_eq!(path.at(0.5), None);
    }
}
