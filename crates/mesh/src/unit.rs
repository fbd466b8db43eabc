//! Length unit of a mesh: given by the user, defined by the format, or the only one that suits the size.
//!
//! glTF defines the metre, and STL files are in millimetres. The other formats define no unit: it is resolved
//! only if the result is a graspable object. Otherwise the import fails and asks for the size.

use crate::{MeshError, MeshOptions};
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
#[derive(Clone, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct ResolvedUnit {
    /// Resolved unit. If the size is given, it is the unit of the format, or the metre.
    pub unit: Unit,
    /// Length (m) of one unit of the file's coordinates, with the scale or the size of the options.
    pub metres_per_unit: f32,
    /// Reason for the user, without a full stop.
    pub reason: String,
}

/// Unit that a format defines or that its files have by convention.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FormatUnit {
    pub(crate) unit: Unit,
    /// Clause of the reason: "as glTF defines".
    pub(crate) reason: &'static str,
}

/// Min and max length (m) of the longest side of an object that a robot hand can grasp.
const GRASPABLE_RANGE_M: [f32; 2] = [0.05, 0.30];
/// Min and max length (m) of the longest side that needs no confirmation, in the unit of the format.
///
/// In other units, a length in this range is unlikely. A mesh of the size 1 or 2, as generators and data sets
/// of normalised meshes have it, is outside.
const ACCEPTED_RANGE_M: [f32; 2] = [0.005, 0.5];
/// Units by preference that are considered if the format defines none.
const UNIT_PREFERENCE: [Unit; 3] = [Unit::Metre, Unit::Millimetre, Unit::Centimetre];
/// Units whose accepted range is considered if no unit fits the graspable range.
///
/// An object of 0.7 units is not 7 mm long, so the centimetre is not one of them.
const WIDE_UNITS: [Unit; 2] = [Unit::Metre, Unit::Millimetre];

/// Unit for a mesh whose longest side is `longest` (units of the file, > 0).
///
/// Fails if the options are invalid, or if they are empty and no unit is certain.
pub(crate) fn resolve_unit(
    longest: f32,
    format: Option<FormatUnit>,
    options: &MeshOptions,
) -> Result<ResolvedUnit, MeshError> {
    options.check()?;
    let resolved = |unit: Unit, factor: f32, fit: &str| {
        let metres_per_unit = unit.metres() * factor;
        let reason = format!("{}, {fit}", describe(longest, unit, factor));
        Ok(ResolvedUnit { unit, metres_per_unit, reason })
    };
    let unit_of_format = format.map_or(Unit::Metre, |format| format.unit);
    if let Some(size) = options.size {
        let (unit, metres_per_unit) = (unit_of_format, size / longest);
        let cm = 100.0 * size;
        let reason = format!("{} units long, scaled to {cm:.1} cm, as specified", units(longest));
        return Ok(ResolvedUnit { unit, metres_per_unit, reason });
    }
    if options.unit.is_some() || options.scale.is_some() {
        let unit = options.unit.unwrap_or(unit_of_format);
        return resolved(unit, options.scale.unwrap_or(1.0), "as specified");
    }
    let is_in = |[min, max]: [f32; 2], unit: Unit| (min..=max).contains(&(longest * unit.metres()));
    if let Some(format) = format {
        if is_in(ACCEPTED_RANGE_M, format.unit) {
            return resolved(format.unit, 1.0, format.reason);
        }
    } else if let Some(unit) = UNIT_PREFERENCE.into_iter().find(|u| is_in(GRASPABLE_RANGE_M, *u)) {
        return resolved(unit, 1.0, "within the graspable range");
    } else if let Some(unit) = WIDE_UNITS.into_iter().find(|unit| is_in(ACCEPTED_RANGE_M, *unit)) {
        return resolved(unit, 1.0, "closest to the graspable range");
    }
    let length = units(longest);
    let length = match format {
        Some(FormatUnit { unit, reason }) => format!("{length} {} long, {reason}", unit.plural()),
        None => format!("{length} units long, and the format defines no unit"),
    };
    Err(MeshError::SizeRequired { length })
}

/// Length in units of the file: three digits are enough to recognise an object.
fn units(longest: f32) -> String {
    match longest {
        100.0.. => format!("{longest:.0}"),
        1.0.. => format!("{longest:.1}"),
        0.01.. => format!("{longest:.3}"),
        _ => format!("{longest:.2e}"),
    }
}

fn describe(longest: f32, unit: Unit, factor: f32) -> String {
    let cm = 100.0 * longest * unit.metres() * factor;
    let scale = if factor == 1.0 { String::new() } else { format!(", scaled by {factor}") };
    format!("{} units long, read as {}{scale}: {cm:.1} cm", units(longest), unit.plural())
}

impl Unit {
    /// All units.
    pub const ALL: [Self; 4] = [Self::Metre, Self::Centimetre, Self::Millimetre, Self::Inch];

    /// Length of the unit (m).
    pub fn metres(self) -> f32 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Inch => 0.0254,
        }
    }

    /// Symbol: m, cm, mm or in.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Inch => "in",
        }
    }

    /// Unit with this symbol.
    pub fn from_symbol(symbol: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.symbol() == symbol)
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

#[cfg(test)]
mod tests {
    use super::*;

    const GLTF: Option<FormatUnit> =
        Some(FormatUnit { unit: Unit::Metre, reason: "as glTF defines" });
    const STL: Option<FormatUnit> =
        Some(FormatUnit { unit: Unit::Millimetre, reason: "as usual in STL" });

    fn resolve(longest: f32, format: Option<FormatUnit>) -> Result<ResolvedUnit, MeshError> {
        resolve_unit(longest, format, &MeshOptions::default())
    }

    #[test]
    fn unit_that_suits_the_size_is_resolved_if_the_format_defines_none() {
        for (longest, unit) in [
            (0.176, Unit::Metre),
            (0.05, Unit::Metre),
            (0.45, Unit::Metre),
            (0.01, Unit::Metre),
            (176.0, Unit::Millimetre),
            (51.0, Unit::Millimetre),
            (31.8, Unit::Millimetre),
            (450.0, Unit::Millimetre),
            (17.6, Unit::Centimetre),
            (10.0, Unit::Centimetre),
        ] {
            let found = resolve(longest, None).unwrap();
            assert_eq!(found.unit, unit, "{longest}: {}", found.reason);
        }
    }

    #[test]
    fn size_is_required_if_no_unit_is_certain() {
        // Normalised meshes, inches, and objects that no unit makes graspable.
        for longest in [1.0, 2.0, 0.7, 3.0, 900.0, 1e5, 1e-4] {
            let error = resolve(longest, None).unwrap_err();
            assert_eq!(error.code(), "size_required", "{longest}: {error}");
        }
        // A bat and a chair in metres; a mesh in metres as STL.
        for (longest, format) in [(0.9, GLTF), (1.2, GLTF), (0.1, STL), (1.0, STL), (2000.0, STL)] {
            let error = resolve(longest, format).unwrap_err();
            assert_eq!(error.code(), "size_required", "{longest}: {error}");
        }
        let text = resolve(0.9, GLTF).unwrap_err().to_string();
        assert!(text.contains("0.900 metres long, as glTF defines"), "{text}");
        assert!(text.contains("Give its size, unit or scale"), "{text}");
    }

    #[test]
    fn unit_of_the_format_is_used_if_the_size_is_plausible() {
        for (longest, format, metres) in [
            (13.0, STL, 0.001),
            (16.0, STL, 0.001),
            (31.8, STL, 0.001),
            (0.26, GLTF, 1.0),
            (0.023, GLTF, 1.0),
        ] {
            assert_eq!(resolve(longest, format).unwrap().metres_per_unit, metres, "{longest}");
        }
    }

    #[test]
    fn given_size_unit_and_scale_override_all_else() {
        let given = |options: MeshOptions| resolve_unit(2.0, STL, &options).unwrap();
        let by_size = given(MeshOptions { size: Some(0.12), ..MeshOptions::default() });
        assert_eq!(by_size.metres_per_unit, 0.06);
        assert_eq!(by_size.reason, "2.0 units long, scaled to 12.0 cm, as specified");
        let inches = MeshOptions { unit: Some(Unit::Inch), ..MeshOptions::default() };
        assert_eq!(given(inches).reason, "2.0 units long, read as inches: 5.1 cm, as specified");
        let scaled = given(MeshOptions { scale: Some(50.0), ..inches });
        assert_eq!(scaled.metres_per_unit, 0.0254 * 50.0);
        let of_format = given(MeshOptions { scale: Some(50.0), ..MeshOptions::default() });
        let reason = "2.0 units long, read as millimetres, scaled by 50: 10.0 cm, as specified";
        assert_eq!(of_format.reason, reason);
    }

    #[test]
    fn reason_states_length_unit_and_fit() {
        let reason = |x: f32| resolve(x, None).unwrap().reason;
        let large = "176 units long, read as millimetres: 17.6 cm, within the graspable range";
        assert_eq!(reason(176.0), large);
        let small = "0.176 units long, read as metres: 17.6 cm, within the graspable range";
        assert_eq!(reason(0.176), small);
        let far = "450 units long, read as millimetres: 45.0 cm, closest to the graspable range";
        assert_eq!(reason(450.0), far);
    }
}
