//! Orientation of an imported object on the table.

/// Orientation of an object on the table; serialized as `"asInFile"` or `{"stablePose": 2}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Orientation {
    /// Orientation of the file.
    AsInFile,
    /// Index of a stable pose; 0 is the most stable one.
    StablePose(usize),
}

/// Reason for an object's orientation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub enum OrientationReason {
    /// Given in the options, or stable in the orientation of the file.
    Given,
    /// The file appears to be y-up.
    YUpFile,
    /// The orientation of the file tilts slightly: the object settles on its base.
    Settled,
    /// The orientation of the file is unstable: the most stable pose is used.
    Unstable,
    /// The orientation of the file is unstable: an [`OrientationChooser`](crate::import::OrientationChooser) selected the pose.
    ChosenByModel,
}

impl OrientationReason {
    /// Message for the user; `None` for [`Self::Given`].
    pub fn message(self) -> Option<&'static str> {
        Some(match self {
            Self::Given => return None,
            Self::YUpFile => "The file appears to be y-up; the object was rotated to z-up.",
            Self::Settled => {
                "The object would tilt slightly in the orientation of the file; the pose after settling is used instead."
            }
            Self::Unstable => {
                "The orientation in the file is unstable; the most stable pose is used instead."
            }
            Self::ChosenByModel => {
                "The orientation in the file is unstable; the stable pose most similar to the training data is used instead."
            }
        })
    }
}
