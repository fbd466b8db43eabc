//! Contacts of the object.

use geometry::Vec3;

/// A contact force on the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactForce {
    /// Point of application (m).
    pub point: Vec3,
    /// Force (N), including friction.
    pub force: Vec3,
}

/// Bodies in contact with the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactState {
    /// Contact with the table.
    pub table: bool,
    /// Contact with a finger or the palm.
    pub hand: bool,
    /// Contact with an arm link.
    pub arm: bool,
}
