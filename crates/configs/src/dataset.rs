//! Configuration of a dataset: its contents, and the named presets.

use objects::catalog::{CATALOG, CatalogEntry};
use objects::generated::{FAMILIES, Family};

/// Format version, incremented when the same configuration generates different data.
///
/// 3: Parquet in LeRobot's layout. 4: object surfaces. 5: overlapping grasps. 6: distinct poses for each
/// object. 7: the hand retreats straight and wide open, within 8 s. 8: grasps shared by family. 9: alternate
/// IK seeds with the arm drawn in. 10: fewer clusters, equal grasps for variants, collision-free motion from
/// home. 11: the fingers squeeze further than necessary. 12: variants are grasped from both sides. 13:
/// variants differ in shoulder height. 14: variants are grasped at the shoulder. 15: much lower shoulders,
/// and grasps that withstand them. 16: grasps of the bottle are selected by their success on similar objects.
/// 17: objects are also placed nearer and farther than in an attempt. 18: this is reverted. 19: new names of
/// fields and columns. 20: environment state, quantiles, dataset card. 21: all replays simulate arm and hand.
/// 22: hands of transferred and searched grasps close above the table. 23: searches pinch low objects.
/// 24: transfers of grasps stop as soon as their result is certain. 25: consistent grasps tolerate hand pose error.
pub const VERSION: u32 = 25;

/// Requested contents of a dataset. Together with the program version, it determines the bytes of the
/// dataset.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetConfig {
    /// [`VERSION`] of the program that generates the dataset.
    pub version: u32,
    /// Seed of all random streams.
    pub seed: u64,
    /// Names of the objects with demonstrations.
    pub objects: Vec<String>,
    /// Whether transferred grasps of the family's reference object ([`objects::catalog::reference_object`])
    /// precede the grasps of an object itself. Similar objects are then grasped in the same way.
    pub share_family_grasps: bool,
    /// Poses of each object on the table (the paper's grid G). All objects share one pose sequence, each with
    /// its own section, so that objects with the same grasps cover many poses.
    pub poses: usize,
    /// Demonstrated poses of an object that looks the same at every yaw, if fewer than `poses`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub round_poses: Option<usize>,
    /// Demonstrations per pose (the paper's M).
    pub trajectories: usize,
    /// Whether to record the same number of demonstrations with each grasp that is preferred at a neighboring
    /// pose. At poses near a change of the preferred grasp, both grasps are then demonstrated.
    pub overlap_grasps: bool,
    /// Whether the preferred grasp of a pose tolerates hand pose error, and agrees with those of similar objects at
    /// similar poses. Otherwise it is the first reachable one of the object.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub consistent_grasps: bool,
    /// The dataset and the policy to which the grasps are adapted; `None` for grasps that are searched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptation: Option<Adaptation>,
    /// Demonstrations per pose that are also replayed with a hold of 2 s and shaken, independent of the outcome
    /// of their first replay.
    pub num_shaken_replays: usize,
    /// Kept demonstrations per pose that are replayed with a perturbed object pose.
    pub num_perturbed_replays: usize,
    /// Azimuths at which each pose is rendered. Demonstrations stay valid when they are rotated with the
    /// object about the vertical axis of the robot.
    pub num_azimuths: usize,
    /// Noisy clouds per azimuth; one clean cloud per azimuth is added.
    pub clouds: usize,
    /// Names of the objects that the encoder is trained on.
    pub encoder_objects: Vec<String>,
    /// Encoder clouds per object.
    pub encoder_clouds: usize,
    /// Whether rows contain the noisy cloud of their episode, in the column `observation.pointcloud`. It has 6
    /// kB per row before compression.
    pub point_cloud_column: bool,
}

/// Origin of the grasps of an adapted dataset.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adaptation {
    /// Hash of the manifest of the dataset whose grasps are adapted.
    pub dataset: String,
    /// Hash of the files of the model whose policy ends near the adapted grasps.
    pub model: String,
}

/// Names of the presets with a description.
pub const PRESETS: [(&str, &str); 6] = [
    ("smoke", "less than a minute: the whole pipeline at toy size"),
    ("small", "minutes: two objects, 24 poses each, 32 demonstrations of each"),
    (
        "variants",
        "dataset of models/ycb-two: 220 poses each of a box in 2 shapes and a bottle in 8",
    ),
    ("paper", "size used in the paper: K = 192 object poses, M = 256 demonstrations of each"),
    ("families", "training objects of all families, some in several shapes, 28 poses each"),
    ("generated", "432 generated objects of 18 families, 30 poses each, 10 of round objects"),
];

/// Training objects of the paper's policies.
const POLICY_OBJECTS: [&str; 2] = ["sugar_box", "bleach"];
/// Training objects of the paper's encoder; the mustard bottle is held out.
const ENCODER_OBJECTS: [&str; 4] = ["sugar_box", "bleach", "cracker_box", "soup_can"];

/// Shape variants per object of [`POLICY_OBJECTS`] in preset `variants`. Boxes are similar to each other,
/// bottles are not.
const POLICY_VARIANTS: [(&str, usize); 2] = [("sugar_box", 2), ("bleach", 8)];
/// Shape variants per encoder object in preset `variants`.
const ENCODER_VARIANTS: usize = 8;

/// Shape variants of the objects in preset `families` that are harder to hold.
const FAMILY_VARIANTS: [(&str, usize); 3] = [("bleach", 16), ("sugar_box", 3), ("cracker_box", 3)];
/// Families with two shape variants per object. Round objects look the same from all azimuths and have enough
/// demonstrations.
const ANGULAR_FAMILIES: [&str; 2] = ["boxes", "bottles"];
/// Objects that no grasp found by the search can lift.
const UNGRASPABLE: [&str; 1] = ["hammer"];

/// Names of the objects with `count` shape variants each, the original shape first.
fn with_variants(objects: impl IntoIterator<Item = (&'static str, usize)>) -> Vec<String> {
    let variant = |name: &str, k| if k == 0 { name.to_owned() } else { format!("{name}.{k}") };
    let all = |(name, count)| (0..count).map(move |k| variant(name, k));
    objects.into_iter().flat_map(all).collect()
}

impl DatasetConfig {
    /// Configuration of a preset in [`PRESETS`].
    ///
    /// ```rust
    /// use configs::DatasetConfig;
    /// // The size used in the paper: K = 192 object poses, M = 256 demonstrations of each.
    /// let paper = DatasetConfig::preset("paper", 0).expect("a preset");
    /// assert_eq!((paper.objects.len() * paper.poses, paper.trajectories), (192, 256));
    /// assert!(DatasetConfig::preset("huge", 0).is_none());
    /// ```
    pub fn preset(name: &str, seed: u64) -> Option<Self> {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let small = Self {
            version: VERSION,
            seed,
            objects: owned(&POLICY_OBJECTS),
            share_family_grasps: false,
            poses: 24,
            round_poses: None,
            trajectories: 32,
            overlap_grasps: false,
            consistent_grasps: false,
            adaptation: None,
            num_shaken_replays: 4,
            num_perturbed_replays: 1,
            num_azimuths: 4,
            clouds: 4,
            encoder_objects: owned(&ENCODER_OBJECTS),
            encoder_clouds: 1000,
            point_cloud_column: false,
        };
        Some(match name {
            "smoke" => Self {
                objects: owned(&POLICY_OBJECTS[..1]),
                poses: 3,
                trajectories: 4,
                num_shaken_replays: 1,
                num_azimuths: 2,
                encoder_objects: owned(&POLICY_OBJECTS[..1]),
                encoder_clouds: 150,
                ..small
            },
            "small" => small,
            "variants" => Self {
                objects: with_variants(POLICY_VARIANTS),
                encoder_objects: with_variants(
                    ENCODER_OBJECTS.map(|name| (name, ENCODER_VARIANTS)),
                ),
                poses: 220,
                trajectories: 2,
                overlap_grasps: true,
                num_shaken_replays: 0,
                num_perturbed_replays: 0,
                num_azimuths: 8,
                encoder_clouds: 900,
                ..small
            },
            "paper" => Self {
                poses: 96,
                trajectories: 256,
                num_shaken_replays: 11,
                num_perturbed_replays: 3,
                num_azimuths: 8,
                encoder_clouds: 9000,
                ..small
            },
            "families" => {
                let train = CATALOG.iter().filter(|entry| entry.is_for_training());
                // Objects that no grasp lifts have no demonstrations.
                let graspable = train.clone().filter(|entry| !UNGRASPABLE.contains(&entry.name));
                let num_variants = |entry: &CatalogEntry| match FAMILY_VARIANTS
                    .iter()
                    .find(|(name, _)| *name == entry.name)
                {
                    Some((_, count)) => *count,
                    None if ANGULAR_FAMILIES.contains(&entry.family) => 2,
                    None => 1,
                };
                Self {
                    encoder_objects: with_variants(train.map(|e| (e.name, num_variants(e)))),
                    objects: with_variants(graspable.map(|e| (e.name, num_variants(e)))),
                    share_family_grasps: true,
                    poses: 28,
                    trajectories: 2,
                    overlap_grasps: true,
                    num_shaken_replays: 0,
                    num_perturbed_replays: 0,
                    num_azimuths: 8,
                    encoder_clouds: 500,
                    ..small
                }
            }
            "generated" => {
                let families = FAMILIES.iter().filter(|family| !family.is_held_out);
                let objects: Vec<String> = families.flat_map(Family::names).collect();
                let catalog = CATALOG.iter().filter(|entry| entry.is_for_training());
                let catalog = catalog.map(|entry| entry.name.to_owned());
                Self {
                    encoder_objects: objects.iter().cloned().chain(catalog).collect(),
                    objects,
                    poses: 30,
                    round_poses: Some(10),
                    trajectories: 2,
                    overlap_grasps: true,
                    consistent_grasps: true,
                    num_shaken_replays: 0,
                    num_perturbed_replays: 0,
                    num_azimuths: 8,
                    clouds: 2,
                    encoder_clouds: 100,
                    ..small
                }
            }
            _ => return None,
        })
    }

    /// Replaces the objects with one object, for both demonstrations and encoder clouds.
    pub fn for_object(self, name: &str) -> Self {
        Self { objects: vec![name.to_owned()], encoder_objects: vec![name.to_owned()], ..self }
    }

    /// Names of all objects without duplicates.
    pub fn all_objects(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for name in self.objects.iter().chain(&self.encoder_objects) {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_have_documented_sizes() {
        for (name, _) in PRESETS {
            assert!(DatasetConfig::preset(name, 0).is_some(), "{name}");
        }
        assert!(DatasetConfig::preset("huge", 0).is_none());
        let paper = DatasetConfig::preset("paper", 0).unwrap();
        assert_eq!((paper.poses * paper.objects.len(), paper.trajectories), (192, 256));
        assert_eq!(paper.encoder_clouds * paper.encoder_objects.len(), 36_000);
        assert!(paper.num_shaken_replays * 192 >= 2000 && paper.num_perturbed_replays * 192 >= 500);
        assert!(!paper.all_objects().contains(&"mustard"));
        let variants = DatasetConfig::preset("variants", 0).unwrap();
        assert_eq!(variants.objects[..2], ["sugar_box", "sugar_box.1"].map(str::to_owned));
        assert!(variants.objects.len() == 10 && !variants.all_objects().contains(&"mustard"));
        let families = DatasetConfig::preset("families", 0).unwrap();
        assert!(families.objects.len() >= 48);
        assert!(!families.all_objects().contains(&"jam_jar"), "jars are held out");
        let generated = DatasetConfig::preset("generated", 0).unwrap();
        assert_eq!(generated.objects.len(), 432);
        let is_held_out = |name: &&str| {
            objects::generated::parse_name(name).is_some_and(|(family, _)| family.is_held_out)
        };
        assert_eq!(generated.all_objects().into_iter().find(is_held_out), None);
    }
}
