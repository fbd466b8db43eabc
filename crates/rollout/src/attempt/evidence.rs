//! Measurements of the object at the outcome, which explain a failure.
//!
//! In: the scene, the hold monitor and the history of the object, at the outcome. Out: numbers, and sentences
//! with them for display. Changes neither the simulation nor the outcome.

use crate::attempt::{FailureReason, Outcome};
use scene::config::AttemptProtocol;
use scene::{ContactState, HoldMonitor};

/// Measurements of the object at the outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Number of fingers in contact with the object.
    pub fingers: usize,
    /// Max of that number since the start of the lift; 0 before it.
    pub max_fingers: usize,
    /// Whether the palm touches the object.
    pub palm: bool,
    /// Whether an arm link touches the object.
    pub arm: bool,
    /// Whether the table touches the object.
    pub table: bool,
    /// Displacement and rotation in the palm; `None` before the lift.
    pub slip: Option<Slip>,
    /// Height (m) of the lowest point of the object above the table.
    pub height: f32,
    /// Max of that height (m) during the attempt.
    pub max_height: f32,
    /// Horizontal displacement (m) of the object since the start of the attempt.
    pub displacement: f32,
    /// Angle (rad) between the object's vertical axis and the vertical.
    pub tilt: f32,
}

/// Max motion of the object in the palm since the start of the lift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Displacement (m).
    pub distance: f32,
    /// Rotation (rad).
    pub rotation: f32,
}

impl From<&HoldMonitor> for Slip {
    fn from(hold: &HoldMonitor) -> Self {
        Self { distance: hold.slip, rotation: hold.rotation }
    }
}

impl Evidence {
    /// Contacts of the object: fingers and palm of the hand, and the other bodies.
    pub(crate) fn with_contacts(self, fingers: usize, palm: bool, others: ContactState) -> Self {
        Self { fingers, palm, arm: others.arm, table: others.table, ..self }
    }

    /// Description of the outcome. An object that was not raised has slipped out of the fingers, or they have
    /// missed it.
    pub fn describe(&self, outcome: Outcome) -> &'static str {
        match outcome {
            Outcome::Failed { reason: FailureReason::Missed } if self.max_fingers > 0 => {
                "Slipped early: the fingers touched the object during the lift, but did not raise it by 3 cm."
            }
            _ => outcome.description(),
        }
    }

    /// The measurements as short statements, with the limits of `protocol`.
    pub fn explain(&self, protocol: &AttemptProtocol) -> String {
        let hold = match self.slip {
            None => "The lift had not started.".into(),
            Some(Slip { distance, rotation }) => format!(
                "Slip in the hand: {} cm (limit {}), {}° (limit {}). Height {} cm (required {}, highest {}).",
                centimetres(distance),
                centimetres(protocol.max_slip),
                degrees(rotation),
                protocol.max_rotation_deg,
                centimetres(self.height),
                centimetres(protocol.min_hold_height),
                centimetres(self.max_height),
            ),
        };
        format!(
            "Contacts: {}{}. {hold} Moved {} cm sideways, tilted {}°.",
            self.contacts(),
            self.lost_contacts(),
            centimetres(self.displacement),
            degrees(self.tilt)
        )
    }

    /// "2 fingers, palm, table", or "none".
    fn contacts(&self) -> String {
        let fingers = match self.fingers {
            0 => None,
            1 => Some("1 finger".to_owned()),
            count => Some(format!("{count} fingers")),
        };
        let others = [(self.palm, "palm"), (self.arm, "arm"), (self.table, "table")]
            .into_iter()
            .filter(|(touches, _)| *touches)
            .map(|(_, name)| name.to_owned());
        let names: Vec<String> = fingers.into_iter().chain(others).collect();
        if names.is_empty() { "none".into() } else { names.join(", ") }
    }

    /// Fingers that have lost the object since the start of the lift.
    fn lost_contacts(&self) -> String {
        match self.max_fingers {
            max if max <= self.fingers => String::new(),
            1 => " (1 finger during the lift)".into(),
            max => format!(" (up to {max} fingers during the lift)"),
        }
    }
}

/// Length (m) in centimetres. Contacts penetrate by fractions of a millimetre, so negative heights are 0.
fn centimetres(metres: f32) -> String {
    let text = format!("{:.1}", 100.0 * metres.max(0.0));
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// Angle (rad) in degrees.
fn degrees(radians: f32) -> String {
    format!("{:.0}", radians.to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::SceneConfig;

    /// An object at rest on the table, without contact to the robot, before the lift.
    const ON_TABLE: Evidence = Evidence {
        fingers: 0,
        max_fingers: 0,
        palm: false,
        arm: false,
        table: true,
        slip: None,
        height: -0.0002,
        max_height: 0.0,
        displacement: 0.0,
        tilt: 0.0,
    };

    #[test]
    fn explanation_states_contacts_slip_and_height_with_their_limits() {
        let protocol = SceneConfig::standard().unwrap().protocol;
        assert_eq!(
            ON_TABLE.explain(&protocol),
            "Contacts: table. The lift had not started. Moved 0 cm sideways, tilted 0°."
        );
        let slip = Some(Slip { distance: 0.0412, rotation: 0.6 });
        let slipped = Evidence {
            fingers: 3,
            max_fingers: 3,
            palm: true,
            table: false,
            slip,
            height: 0.1234,
            max_height: 0.13,
            displacement: 0.02,
            tilt: 0.5,
            ..ON_TABLE
        };
        assert_eq!(
            slipped.explain(&protocol),
            "Contacts: 3 fingers, palm. Slip in the hand: 4.1 cm (limit 3), 34° (limit 30). Height 12.3 cm \
             (required 10, highest 13). Moved 2 cm sideways, tilted 29°."
        );
    }

    #[test]
    fn contacts_are_listed_by_body() {
        let contacts = |fingers, palm, arm, table| {
            let others = ContactState { hand: fingers > 0 || palm, arm, table };
            ON_TABLE.with_contacts(fingers, palm, others).contacts()
        };
        assert_eq!(contacts(0, false, false, false), "none");
        assert_eq!(contacts(1, false, false, false), "1 finger");
        assert_eq!(contacts(4, false, true, true), "4 fingers, arm, table");
        let lost = |max_fingers| Evidence { fingers: 1, max_fingers, ..ON_TABLE }.lost_contacts();
        assert_eq!(
            (lost(1).as_str(), lost(3).as_str()),
            ("", " (up to 3 fingers during the lift)")
        );
    }

    #[test]
    fn object_that_was_not_raised_is_described_by_its_contacts() {
        let missed = Outcome::Failed { reason: FailureReason::Missed };
        assert!(ON_TABLE.describe(missed).starts_with("Missed: "));
        // The fingers have lost the object before the outcome.
        let gripped = Evidence { max_fingers: 2, ..ON_TABLE };
        assert!(gripped.describe(missed).starts_with("Slipped early: the fingers touched"));
        let slipped = Outcome::Failed { reason: FailureReason::Slipped };
        assert_eq!(gripped.describe(slipped), slipped.description());
    }
}
