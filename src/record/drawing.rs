//! The arm, what it carries and the object as 3-D viewers draw them: frames and simple shapes.

use foxglove::messages::{
    Color, CylinderPrimitive, FrameTransform, FrameTransforms, JointState, JointStates,
    LinePrimitive, Point3, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive, Timestamp,
    Vector3 as FoxVector3, line_primitive,
};
use nalgebra::{Isometry3, Matrix3, SymmetricEigen, UnitQuaternion, Vector3};
use physics::arm::ArmModel;
use shm_types::episode::TickRecord;

use super::solids::{Solid, Solids};

const WORLD: &str = "world";

/// Radius of the links as drawn: an arm of the model has no shape.
const LINK_RADIUS_M: f64 = 0.035;
/// Semi-axis of the stiffness ellipsoid per √(s⁻²): 500 s⁻² are drawn 0.1 m long.
const ELLIPSOID_M_S: f64 = 0.1 / 22.36;

const STEEL: [f64; 4] = [0.62, 0.65, 0.70, 1.0];
const SPRING: [f64; 4] = [0.16, 0.47, 0.84, 0.35];
const TARGET: [f64; 4] = [0.84, 0.22, 0.16, 0.9];
const STRING: [f64; 4] = [0.45, 0.45, 0.45, 1.0];
/// Thickness of the string, m.
const STRING_THICKNESS_M: f64 = 0.004;

/// Draws one arm with what it carries.
pub struct Drawing {
    model: ArmModel,
    solids: Solids,
}

impl Drawing {
    pub fn new(model: ArmModel, solids: Solids) -> Drawing {
        Drawing { model, solids }
    }

    pub fn n_joints(&self) -> usize {
        self.model.n_joints()
    }

    /// Every joint's frame in the one before it, the tip in the last of them, the object in the world.
    pub fn transforms(&self, record: &TickRecord, at: Timestamp) -> FrameTransforms {
        let names = self.model.joint_names();
        let mut transforms = Vec::new();
        let mut parent = WORLD;
        let mut add = |parent: &str, child: &str, pose: &Isometry3<f64>| {
            transforms.push(FrameTransform {
                timestamp: Some(at),
                parent_frame_id: parent.into(),
                child_frame_id: child.into(),
                translation: Some(vector(&pose.translation.vector)),
                rotation: Some(quaternion(&pose.rotation)),
            });
        };
        for (i, body) in self.model.bodies().iter().enumerate() {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), record.q[i]);
            add(parent, &names[i], &(body.X_AB0() * turn));
            parent = &names[i];
        }
        add(parent, self.solids.tip.0, &self.model.tip_offset());
        let [w, i, j, k] = record.object_quaternion;
        let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
        let position = Vector3::from(record.object_position);
        add(WORLD, self.solids.object.0, &Isometry3::from_parts(position.into(), turn));
        FrameTransforms { transforms }
    }

    pub fn joint_states(&self, record: &TickRecord, at: Timestamp) -> JointStates {
        let names = self.model.joint_names().iter().enumerate();
        let joints = names.map(|(i, name)| JointState {
            name: name.clone(),
            position: Some(rounded(record.q[i])),
            velocity: Some(rounded(record.qd[i])),
            acceleration: None,
            effort: Some(rounded(record.tau[i])),
        });
        JointStates { timestamp: Some(at), joints: joints.collect() }
    }

    /// Arm, tip and object, each fixed to its frame: they move with the transforms.
    pub fn bodies(&self, at: Timestamp) -> SceneUpdate {
        let names = self.model.joint_names();
        let mut entities = Vec::new();
        let mut parent = WORLD;
        for (i, body) in self.model.bodies().iter().enumerate() {
            entities.extend(link(parent, &body.p_AB, at));
            parent = &names[i];
        }
        entities.extend(link(parent, &self.model.tip_offset().translation.vector, at));
        for (frame, solids) in [&self.solids.tip, &self.solids.object] {
            entities.push(solid_entity(frame, solids, at));
        }
        SceneUpdate { deletions: Vec::new(), entities }
    }

    /// The attractor, and the stiffness as an ellipsoid around the tip: semi-axes along the
    /// principal directions of Σ hᵢ Kᵢ, their lengths as the roots of the stiffnesses.
    /// `stiffness` is its packed lower triangle.
    pub fn springs(&self, record: &TickRecord, stiffness: &[f64], at: Timestamp) -> SceneUpdate {
        let block = Matrix3::from_fn(|r, c| {
            let (row, column) = (r.max(c), r.min(c));
            stiffness.get(row * (row + 1) / 2 + column).copied().unwrap_or(0.0)
        });
        let eigen = SymmetricEigen::new(block);
        let mut axes = eigen.eigenvectors;
        if axes.determinant() < 0.0 {
            axes.column_mut(0).neg_mut();
        }
        let turn = UnitQuaternion::from_matrix(&axes);
        let length = |i: usize| 2.0 * ELLIPSOID_M_S * eigen.eigenvalues[i].max(0.0).sqrt();
        let [x, y, z, ..] = record.x;
        let ellipsoid = SpherePrimitive {
            pose: Some(pose(&Isometry3::from_parts(Vector3::new(x, y, z).into(), turn))),
            size: Some(FoxVector3 { x: length(0), y: length(1), z: length(2) }),
            color: Some(rgba(SPRING)),
        };
        let [x, y, z, ..] = record.attractor;
        let attractor = SpherePrimitive {
            pose: Some(pose(&Isometry3::translation(x, y, z))),
            size: Some(FoxVector3 { x: 0.03, y: 0.03, z: 0.03 }),
            color: Some(rgba(TARGET)),
        };
        let spheres = vec![ellipsoid, attractor];
        let lines = self.solids.has_string.then(|| string(record)).into_iter().collect();
        let springs = SceneEntity { spheres, lines, ..entity("springs", WORLD, at, Vec::new()) };
        SceneUpdate { deletions: Vec::new(), entities: vec![springs] }
    }
}

/// A link from the origin of `frame` to `p`, m; none where there is no way between.
fn link(frame: &str, p: &Vector3<f64>, at: Timestamp) -> Option<SceneEntity> {
    let length = p.norm();
    if length < LINK_RADIUS_M {
        return None;
    }
    let along = UnitQuaternion::rotation_between(&Vector3::z(), p).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    });
    let cylinder = CylinderPrimitive {
        pose: Some(pose(&Isometry3::from_parts((p * 0.5).into(), along))),
        size: Some(FoxVector3 { x: 2.0 * LINK_RADIUS_M, y: 2.0 * LINK_RADIUS_M, z: length }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(rgba(STEEL)),
    };
    Some(entity(&format!("link after {frame}"), frame, at, vec![cylinder]))
}

/// Shapes that move with `frame`.
fn solid_entity(frame: &str, solids: &[Solid], at: Timestamp) -> SceneEntity {
    let (mut cylinders, mut spheres) = (Vec::new(), Vec::new());
    for solid in solids {
        match *solid {
            Solid::Cone { bottom_radius, top_radius, height, z, color } => {
                let radius = bottom_radius.max(top_radius);
                cylinders.push(CylinderPrimitive {
                    pose: Some(pose(&Isometry3::translation(0.0, 0.0, z))),
                    size: Some(FoxVector3 { x: 2.0 * radius, y: 2.0 * radius, z: height }),
                    bottom_scale: bottom_radius / radius,
                    top_scale: top_radius / radius,
                    color: Some(rgba(color)),
                });
            }
            Solid::Ball { radius, color } => spheres.push(SpherePrimitive {
                pose: Some(pose(&Isometry3::identity())),
                size: Some(FoxVector3 { x: 2.0 * radius, y: 2.0 * radius, z: 2.0 * radius }),
                color: Some(rgba(color)),
            }),
        }
    }
    SceneEntity { spheres, ..entity(frame, frame, at, cylinders) }
}

/// From the tip to the object, in the world.
fn string(record: &TickRecord) -> LinePrimitive {
    let ends = [[record.x[0], record.x[1], record.x[2]], record.object_position];
    LinePrimitive {
        r#type: line_primitive::Type::LineStrip as i32,
        thickness: STRING_THICKNESS_M,
        points: ends.map(|[x, y, z]| Point3 { x: rounded(x), y: rounded(y), z: rounded(z) }).into(),
        color: Some(rgba(STRING)),
        ..LinePrimitive::default()
    }
}

fn entity(id: &str, frame: &str, at: Timestamp, cylinders: Vec<CylinderPrimitive>) -> SceneEntity {
    SceneEntity {
        timestamp: Some(at),
        frame_id: frame.into(),
        id: id.into(),
        frame_locked: true,
        cylinders,
        ..SceneEntity::default()
    }
}

/// To 2⁻¹⁴: what nobody sees need not be stored.
fn rounded(value: f64) -> f64 {
    const GRID: f64 = 16384.0;
    (value * GRID).round() / GRID
}

fn vector(v: &Vector3<f64>) -> FoxVector3 {
    FoxVector3 { x: rounded(v.x), y: rounded(v.y), z: rounded(v.z) }
}

fn quaternion(q: &UnitQuaternion<f64>) -> Quaternion {
    Quaternion { x: rounded(q.i), y: rounded(q.j), z: rounded(q.k), w: rounded(q.w) }
}

fn pose(at: &Isometry3<f64>) -> Pose {
    Pose {
        position: Some(vector(&at.translation.vector)),
        orientation: Some(quaternion(&at.rotation)),
    }
}

fn rgba([r, g, b, a]: [f64; 4]) -> Color {
    Color { r, g, b, a }
}
