//! The drawing of a recording as JSON for the page: frames, bodies and springs.

use foxglove::messages::{
    Color, CylinderPrimitive, FrameTransforms, LinePrimitive, Point3, Pose, Quaternion,
    SceneEntity, SceneUpdate, SpherePrimitive, Vector3,
};
use serde_json::{Value, json};
use shm_types::telemetry::TelemetryTick;

use crate::record::scribe::Scribe;

/// Names of the frames, each with its parent, and the bodies fixed to them; null without an arm.
pub fn still(scribe: &Scribe) -> Value {
    let (Some(bodies), Some((frames, _))) =
        (scribe.drawn_once(), scribe.drawn(&TelemetryTick::ZERO))
    else {
        return Value::Null;
    };
    let frames = frames
        .transforms
        .iter()
        .map(|frame| json!({ "name": frame.child_frame_id, "parent": frame.parent_frame_id }));
    json!({ "frames": frames.collect::<Vec<_>>(), "bodies": entities(&bodies) })
}

/// Where the frames are in their parents, in the order of [`still`], and the springs; null without an arm.
pub fn moving(scribe: &Scribe, tick: &TelemetryTick) -> Value {
    let Some((frames, springs)) = scribe.drawn(tick) else { return Value::Null };
    json!({ "frames": placed(&frames), "springs": entities(&springs) })
}

fn placed(frames: &FrameTransforms) -> Vec<Vec<f64>> {
    let place = |position: &Option<Vector3>, turn: &Option<Quaternion>| {
        let (p, q) = (position.unwrap_or_default(), turn.unwrap_or_default());
        [p.x, p.y, p.z, q.x, q.y, q.z, q.w].map(short).to_vec()
    };
    frames.transforms.iter().map(|frame| place(&frame.translation, &frame.rotation)).collect()
}

fn entities(update: &SceneUpdate) -> Vec<Value> {
    let entity = |entity: &SceneEntity| {
        json!({
            "id": entity.id,
            "frame": entity.frame_id,
            "cylinders": entity.cylinders.iter().map(cylinder).collect::<Vec<_>>(),
            "spheres": entity.spheres.iter().map(sphere).collect::<Vec<_>>(),
            "lines": entity.lines.iter().map(line).collect::<Vec<_>>(),
        })
    };
    update.entities.iter().map(entity).collect()
}

fn cylinder(it: &CylinderPrimitive) -> Value {
    json!({
        "pose": pose(&it.pose), "size": size(&it.size), "color": color(&it.color),
        "bottom": short(it.bottom_scale), "top": short(it.top_scale),
    })
}

fn sphere(it: &SpherePrimitive) -> Value {
    json!({ "pose": pose(&it.pose), "size": size(&it.size), "color": color(&it.color) })
}

fn line(it: &LinePrimitive) -> Value {
    let point = |p: &Point3| [p.x, p.y, p.z].map(short);
    json!({ "points": it.points.iter().map(point).collect::<Vec<_>>(), "color": color(&it.color) })
}

fn pose(it: &Option<Pose>) -> [f64; 7] {
    let pose = it.unwrap_or_default();
    let (p, q) = (pose.position.unwrap_or_default(), pose.orientation.unwrap_or_default());
    [p.x, p.y, p.z, q.x, q.y, q.z, q.w].map(short)
}

fn size(it: &Option<Vector3>) -> [f64; 3] {
    let size = it.unwrap_or_default();
    [size.x, size.y, size.z].map(short)
}

fn color(it: &Option<Color>) -> [f64; 4] {
    let color = it.unwrap_or_default();
    [color.r, color.g, color.b, color.a].map(short)
}

/// Four decimals: less than a pixel.
fn short(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
