//! Object poses on the table: x, y (m), yaw (rad).

/// Rotates an object pose about the vertical axis of the robot by an angle (rad).
pub fn rotate_pose([x, y, yaw]: [f32; 3], turn: f32) -> [f32; 3] {
    let (sin, cos) = (libm::sinf(turn), libm::cosf(turn));
    [cos * x - sin * y, sin * x + cos * y, yaw + turn]
}
