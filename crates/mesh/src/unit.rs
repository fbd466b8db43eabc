//! Unit of a mesh: most formats define none, so it is guessed from the size of graspable objects.

use glamx::Vec3;
use std::fmt;

/// Unit of length of mesh coordinates; serialized as its symbol.
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

/// Unit of a mesh, with the reason for the choice.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedUnit {
    /// Guessed or given unit.
    pub unit: Unit,
    /// Reason for the user, without a full stop.
    pub reason: String,
}

/// Min and max length (m) of the longest side of an object that a robot hand can grasp.
const GRASPABLE_RANGE_M: [f32; 2] = [0.05, 0.30];

/// Units by preference, if several fit.
const UNIT_PREFERENCE: [Unit; 4] = [Unit::Metre, Unit::Millimetre, Unit::Centimetre, Unit::Inch];

/// Guesses the unit in which the longest side (units of the file) is closest to the graspable range.
pub fn guess_unit(extent: Vec3) -> ResolvedUnit {
    let longest = extent.max_element();
    let mut best = (Unit::Metre, f32::INFINITY);
    for unit in UNIT_PREFERENCE {
        let mismatch = size_mismatch(longest * unit.metres());
        if mismatch < best.1 {
            best = (unit, mismatch);
        }
    }
    let (unit, mismatch) = best;
    let fit = if mismatch <= 1.0 {
        "within the graspable range"
    } else {
        "closest to the graspable range"
    };
    ResolvedUnit { unit, reason: format!("{}, {fit}", describe(longest, unit)) }
}

/// Factor (>= 1) by which a length (m) is outside the graspable range; 1 within it.
fn size_mismatch(length: f32) -> f32 {
    let [min, max] = GRASPABLE_RANGE_M;
    (min / length).max(length / max).max(1.0)
}

fn describe(longest: f32, unit: Unit) -> String {
    // Three digits are enough to recognise an object.
    let units = match longest {
        100.0.. => format!("{longest:.0}"),
        1.0.. => format!("{longest:.1}"),
        0.01.. => format!("{longest:.3}"),
        _ => format!("{longest:.2e}"),
    };
    let length_cm = 100.0 * longest * unit.metres();
    format!("{units} units long, read as {}: {length_cm:.1} cm", unit.plural())
}

impl Unit {
    /// Length of the unit (m).
    pub fn metres(self) -> f32 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Inch => 0.0254,
        }
    }

    /// English name, singular.
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

impl ResolvedUnit {
    /// Unit given by the user; `extent` in units of the file.
    pub(super) fn from_user(unit: Unit, extent: Vec3) -> Self {
        let length = describe(extent.max_element(), unit);
        Self { unit, reason: format!("{length}, as specified") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guess_selects_the_unit_closest_to_the_graspable_range() {
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
            let guess = guess_unit(Vec3::new(longest / 3.0, longest, longest / 2.0));
            assert_eq!(guess.unit, unit, "{longest}: {}", guess.reason);
        }
    }

    #[test]
    fn reason_states_length_unit_and_fit() {
        let reason = |x: f32| guess_unit(Vec3::splat(x)).reason;
        let large = "176 units long, read as millimetres: 17.6 cm, within the graspable range";
        assert_eq!(reason(176.0), large);
        let small = "0.176 units long, read as metres: 17.6 cm, within the graspable range";
        assert_eq!(reason(0.176), small);
        let far = "500 units long, read as millimetres: 50.0 cm, closest to the graspable range";
        assert_eq!(reason(500.0), far);
        let given = ResolvedUnit::from_user(Unit::Inch, Vec3::splat(3.0)).reason;
        assert_eq!(given, "3.0 units long, read as inches: 7.6 cm, as specified");
    }
}
