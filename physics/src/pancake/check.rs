//! Refuses pancake worlds that cannot exist.

use super::PancakeConfig;

/// A number that makes no pancake world, with the field and the remedy.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PancakeConfigError {
    /// A length, mass, time or frequency is not a number above zero.
    #[error("{field} is {value}; it must be a number greater than zero")]
    NotPositive { field: &'static str, value: f64 },
    /// A coefficient is outside its range.
    #[error("{field} is {value}; it must lie from {min} to {max}")]
    OutOfRange { field: &'static str, value: f64, min: f64, max: f64 },
    /// A count is too small.
    #[error("{field} is {value}; it must be at least {min}")]
    TooFew { field: &'static str, value: usize, min: usize },
}

impl PancakeConfig {
    /// Checks every field on its own and that the pancake starts inside the pan.
    ///
    /// # Errors
    /// [`PancakeConfigError`] names the first field that is wrong.
    pub fn check(&self) -> Result<(), PancakeConfigError> {
        let positive = [
            ("period_s", self.period_s),
            ("contact_frequency_hz", self.contact_frequency_hz),
            ("contact_damping_ratio", self.contact_damping_ratio),
            ("pan_radius", self.pan_radius),
            ("pan_thickness", self.pan_thickness),
            ("rim_height", self.rim_height),
            ("rim_thickness", self.rim_thickness),
            ("pancake_radius", self.pancake_radius),
            ("pancake_thickness", self.pancake_thickness),
            ("pancake_border", self.pancake_border),
            ("pancake_mass", self.pancake_mass),
            ("start_gap", self.start_gap),
        ];
        for (field, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(PancakeConfigError::NotPositive { field, value });
            }
        }
        for (field, value, min) in [
            ("solver_iterations", self.solver_iterations, 1),
            ("rim_segments", self.rim_segments, 3),
        ] {
            if value < min {
                return Err(PancakeConfigError::TooFew { field, value, min });
            }
        }
        // The border rounds the edge from both faces; a full half would leave no cylinder.
        let max_border = 0.45 * self.pancake_thickness;
        let [x, y] = self.pancake_offset;
        let free = (self.pan_radius - self.pancake_radius).max(0.0);
        for (field, value, min, max) in [
            ("rim_tilt", self.rim_tilt, 0.0, 1.4),
            ("friction", self.friction, 0.0, f64::MAX),
            ("restitution", self.restitution, 0.0, 1.0),
            ("pancake_border", self.pancake_border, 0.0, max_border),
            ("the length of pancake_offset", x.hypot(y), 0.0, free),
        ] {
            if !(min..=max).contains(&value) {
                return Err(PancakeConfigError::OutOfRange { field, value, min, max });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(change: impl Fn(&mut PancakeConfig)) -> String {
        let mut config = PancakeConfig::default();
        change(&mut config);
        config.check().unwrap_err().to_string()
    }

    #[test]
    fn accepts_the_default() {
        assert_eq!(PancakeConfig::default().check(), Ok(()));
    }

    #[test]
    fn names_the_field_that_is_wrong() {
        assert!(refused(|c| c.pancake_mass = 0.0).starts_with("pancake_mass is 0"));
        assert!(refused(|c| c.period_s = f64::NAN).starts_with("period_s is NaN"));
        assert!(refused(|c| c.rim_segments = 2).starts_with("rim_segments is 2"));
        assert!(refused(|c| c.restitution = 1.5).starts_with("restitution is 1.5"));
        assert!(refused(|c| c.friction = f64::NAN).starts_with("friction is NaN"));
        assert!(refused(|c| c.pancake_border = 0.005).starts_with("pancake_border is 0.005"));
        assert!(refused(|c| c.pancake_offset = [0.04, 0.04]).contains("pancake_offset"));
    }
}
