//! A ball on a string, and the cup it may fall into: impulses in closed form.

use nalgebra::{Isometry3, Point3, Vector2, Vector3};

use super::CupConfig;

/// Approaches slower than this do not bounce, m/s: a ball at rest stays at rest.
const RESTING_SPEED: f64 = 0.1;

/// The cup during one sub-step: pose at its end, velocities of P.
#[derive(Debug, Clone, Copy)]
pub struct CupMotion {
    pub X_WP: Isometry3<f64>,
    /// m/s, in the world.
    pub v_WP: Vector3<f64>,
    /// rad/s, in the world.
    pub w_WP: Vector3<f64>,
}

impl CupMotion {
    fn velocity_at(&self, p_W: &Vector3<f64>) -> Vector3<f64> {
        self.v_WP + self.w_WP.cross(&(p_W - self.X_WP.translation.vector))
    }
}

/// What the ball does to the cup: impulse, N·s, and its moment about P, N·m·s, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reaction {
    pub impulse: Vector3<f64>,
    pub moment: Vector3<f64>,
}

impl Reaction {
    pub const NONE: Reaction =
        Reaction { impulse: Vector3::new(0.0, 0.0, 0.0), moment: Vector3::new(0.0, 0.0, 0.0) };
}

/// A point mass with a radius; it does not spin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Centre, m, and its velocity, m/s, in the world.
    pub p_WO: Vector3<f64>,
    pub v_WO: Vector3<f64>,
    pub is_touching: bool,
}

impl Ball {
    /// At rest below the cup at `X_WP`, the string just tight.
    pub fn hanging(X_WP: &Isometry3<f64>, config: &CupConfig) -> Ball {
        let p_WO = X_WP.translation.vector - Vector3::z() * config.string_length;
        Ball { p_WO, v_WO: Vector3::zeros(), is_touching: false }
    }

    /// One sub-step of `dt` s: it flies, the string holds it back, the cup keeps it out or in.
    ///
    /// The string takes the speed that would lengthen it, without a rebound; it pulls and never
    /// pushes. What ball and cup do to each other is added to `reaction`.
    pub fn step(
        &mut self,
        cup: &CupMotion,
        gravity: &Vector3<f64>,
        dt: f64,
        config: &CupConfig,
        reaction: &mut Reaction,
    ) {
        self.v_WO += gravity * dt;
        self.p_WO += self.v_WO * dt;
        let before = self.v_WO;
        self.pull(cup, config);
        reaction.impulse -= (self.v_WO - before) * config.ball_mass;
        self.collide(cup, config, reaction);
    }

    fn pull(&mut self, cup: &CupMotion, config: &CupConfig) {
        let along = self.p_WO - cup.X_WP.translation.vector;
        let length = along.norm();
        if length <= config.string_length {
            return;
        }
        let outwards = along / length;
        self.p_WO = cup.X_WP.translation.vector + outwards * config.string_length;
        let speed = (self.v_WO - cup.v_WP).dot(&outwards);
        self.v_WO -= outwards * speed.max(0.0);
    }

    fn collide(&mut self, cup: &CupMotion, config: &CupConfig, reaction: &mut Reaction) {
        let p_PO = cup.X_WP.inverse_transform_point(&self.p_WO.into()).coords;
        let (nearest_P, distance) = nearest(&p_PO, config);
        let reach = config.ball_radius + config.wall_thickness / 2.0;
        self.is_touching = distance < reach;
        if !self.is_touching || distance == 0.0 {
            return;
        }
        let normal = cup.X_WP.rotation * ((p_PO - nearest_P) / distance);
        self.p_WO += normal * (reach - distance);
        let contact = cup.X_WP * Point3::from(nearest_P);
        let slip = self.v_WO - cup.velocity_at(&contact.coords);
        let approach = -slip.dot(&normal);
        if approach <= 0.0 {
            return;
        }
        let bounce = if approach > RESTING_SPEED { config.restitution } else { 0.0 };
        let push = (1.0 + bounce) * approach;
        let sliding = slip + normal * approach;
        // Coulomb: against the sliding, at most what stops it.
        let rub = sliding.cap_magnitude(config.friction * push);
        let change = normal * push - rub;
        self.v_WO += change;
        let impulse = -change * config.ball_mass;
        reaction.impulse += impulse;
        reaction.moment += (contact.coords - cup.X_WP.translation.vector).cross(&impulse);
    }

    /// Within the cup's walls, below its rim; `p_PO` is the centre in the cup's frame, m.
    pub fn is_inside(p_PO: &Vector3<f64>, config: &CupConfig) -> bool {
        let share = p_PO.z / config.depth;
        let radius = config.bottom_radius + share * (config.rim_radius - config.bottom_radius);
        (0.0..1.0).contains(&share) && p_PO.xy().norm() < radius
    }
}

/// The point of the cup's middle surface that is nearest to `p`, both in the cup's frame, and how far it is,
/// m: bottom and wall are two lines in the plane of the axis and `p`.
fn nearest(p: &Vector3<f64>, config: &CupConfig) -> (Vector3<f64>, f64) {
    let rho = p.xy().norm();
    let outwards = if rho > 0.0 { p.xy() / rho } else { Vector2::x() };
    let flat = Vector2::new(rho, p.z);
    let edge = Vector2::new(config.bottom_radius, 0.0);
    let wall = Vector2::new(config.rim_radius, config.depth) - edge;
    let share = ((flat - edge).dot(&wall) / wall.norm_squared()).clamp(0.0, 1.0);
    let on_wall = edge + wall * share;
    let on_bottom = Vector2::new(rho.min(config.bottom_radius), 0.0);
    let is_wall = (flat - on_wall).norm() < (flat - on_bottom).norm();
    let on_cup = if is_wall { on_wall } else { on_bottom };
    (Vector3::new(outwards.x * on_cup.x, outwards.y * on_cup.x, on_cup.y), (flat - on_cup).norm())
}
