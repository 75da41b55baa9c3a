//! Shapes of what an arm carries and of the tracked object, for 3-D viewers.

/// A shape around the z axis of its frame; lengths in m, colour as red, green, blue, opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// A cone without its point, its middle at `z`.
    Cone { bottom_radius: f64, top_radius: f64, height: f64, z: f64, color: [f64; 4] },
    /// A ball around the origin.
    Ball { radius: f64, color: [f64; 4] },
}

/// What stands at the tip's frame, and what the object is.
#[derive(Clone, Debug, PartialEq)]
pub struct Solids {
    /// Name of the frame, and what is fixed to it.
    pub tip: (&'static str, Vec<Solid>),
    pub object: (&'static str, Vec<Solid>),
    /// A string leads from the tip to the object.
    pub has_string: bool,
}

impl Solids {
    /// What the tip and the object are called.
    pub fn names(&self) -> (&'static str, &'static str) {
        (self.tip.0, self.object.0)
    }
}
