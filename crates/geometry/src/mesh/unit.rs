//! The unit of a mesh: files rarely say it, so it is guessed from what a hand can hold.

use crate::Vec3;
use std::fmt;

/// A unit of length that mesh files are drawn in; written as its symbol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
pub enum Unit {
    /// 1 m.
    #[serde(rename = "m")]
    Metre,
    /// 0.01 m.
    #[serde(rename = "cm")]
    Centimetre,
    /// 0.001 m.
    #[serde(rename = "mm")]
    Millimetre,
    /// 0.0254 m.
    #[serde(rename = "in")]
    Inch,
}

/// A unit and the reason for it.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitGuess {
    /// The unit.
    pub unit: Unit,
    /// One sentence for people.
    pub reason: String,
}

/// Longest side (m) of what the Allegro hand can hold.
const GRASPABLE: [f32; 2] = [0.05, 0.30];

/// Units in the order in which they are preferred where several fit.
const PREFERENCE: [Unit; 4] = [Unit::Metre, Unit::Millimetre, Unit::Centimetre, Unit::Inch];

/// The unit in which the longest side comes nearest to what a hand can hold.
pub fn guess(extent: Vec3) -> UnitGuess {
    let longest = extent.max_element();
    let mut best = (Unit::Metre, f32::INFINITY);
    for unit in PREFERENCE {
        let misfit = misfit(longest * unit.metres());
        if misfit < best.1 {
            best = (unit, misfit);
        }
    }
    let (unit, misfit) = best;
    let verdict =
        if misfit <= 1.0 { "which a hand can hold" } else { "the nearest to what a hand can hold" };
    UnitGuess {
        unit,
        reason: format!("{} if {}, {verdict}", describe(longest, unit), unit.plural()),
    }
}

/// By which factor a length (m) is too short or too long for the hand; 1 if it is neither.
fn misfit(length: f32) -> f32 {
    let [least, most] = GRASPABLE;
    (least / length).max(length / most).max(1.0)
}

fn describe(longest: f32, unit: Unit) -> String {
    // Three digits are enough to recognise a thing by.
    let units = match longest {
        100.0.. => format!("{longest:.0}"),
        1.0.. => format!("{longest:.1}"),
        0.01.. => format!("{longest:.3}"),
        _ => format!("{longest:.2e}"),
    };
    format!("{units} units long: {:.1} cm", 100.0 * longest * unit.metres())
}

impl Unit {
    /// The unit in metres.
    pub fn metres(self) -> f32 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Inch => 0.0254,
        }
    }

    /// Its name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Metre => "metre",
            Self::Centimetre => "centimetre",
            Self::Millimetre => "millimetre",
            Self::Inch => "inch",
        }
    }

    fn plural(self) -> &'static str {
        match self {
            Self::Metre => "metres",
            Self::Centimetre => "centimetres",
            Self::Millimetre => "millimetres",
            Self::Inch => "inches",
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl UnitGuess {
    /// A unit that a person chose.
    pub(super) fn chosen(unit: Unit, extent: Vec3) -> Self {
        let length = describe(extent.max_element(), unit);
        Self { unit, reason: format!("{length} in {}, as chosen", unit.plural()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_the_one_a_hand_can_hold() {
        for (longest, unit) in [
            (0.176, Unit::Metre),
            (0.05, Unit::Metre),
            (0.5, Unit::Metre),
            (176.0, Unit::Millimetre),
            (51.0, Unit::Millimetre),
            (900.0, Unit::Millimetre),
            (17.6, Unit::Centimetre),
            (10.0, Unit::Centimetre),
            (3.0, Unit::Inch),
            (0.01, Unit::Metre),
        ] {
            let guess = guess(Vec3::new(longest / 3.0, longest, longest / 2.0));
            assert_eq!(guess.unit, unit, "{longest}: {}", guess.reason);
        }
    }

    #[test]
    fn the_reason_is_a_sentence_with_the_numbers() {
        let reason = |x: f32| guess(Vec3::splat(x)).reason;
        assert_eq!(reason(176.0), "176 units long: 17.6 cm if millimetres, which a hand can hold");
        assert_eq!(reason(0.176), "0.176 units long: 17.6 cm if metres, which a hand can hold");
        let far = "500 units long: 50.0 cm if millimetres, the nearest to what a hand can hold";
        assert_eq!(reason(500.0), far);
        let chosen = UnitGuess::chosen(Unit::Inch, Vec3::splat(3.0)).reason;
        assert_eq!(chosen, "3.0 units long: 7.6 cm in inches, as chosen");
    }
}
