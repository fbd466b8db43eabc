//! What a dataset holds, and the sizes that have names.

use geometry::catalog::{CATALOG, Entry};

/// Counts the changes of what a configuration makes: 3, Parquet in LeRobot's layout; 4, surfaces of objects; 5, overlap;
/// 6, each object stands at poses of its own; 7, the hand leaves straight back and wide open, within 8 s; 8, grasps by
/// family; 9, the arm draws in where it must; 10, fewer kinds, variants grasped alike, and a free way from home; 11, the
/// fingers press further than they have to; 12, variants are grasped from both sides; 13, they differ in where
/// shoulders are, too; 14, and are grasped there; 15, much lower shoulders, and grasps that bear
/// them; 16, the bottle is grasped by what lifts what is like it; 17, objects stand nearer and farther than in an attempt;
/// 18, they no longer do.
pub const VERSION: u32 = 18;

/// What a dataset holds; this and the program decide its bytes.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetConfig {
    /// [`VERSION`] of the program that makes it.
    pub version: u32,
    /// Seed of everything.
    pub seed: u64,
    /// Objects with demonstrations.
    pub objects: Vec<String>,
    /// Whether the grasps of a family's exemplar ([`geometry::catalog::exemplar_of`]), carried over, come before an
    /// object's own: what looks alike is then grasped alike.
    pub grasps_by_family: bool,
    /// Poses of each of them on the table (the paper's grid G). Those of the next object go on where these end, so that
    /// objects that are grasped alike are so at many poses.
    pub poses: usize,
    /// Demonstrations of each pose (the paper's M).
    pub trajectories: usize,
    /// Whether as many are made with each grasp that comes first at a pose a little beside: where one grasp takes over
    /// from another, both are then demonstrated on both sides.
    pub overlap: bool,
    /// Demonstrations of each pose that are replayed with arm and hand and shaken, too, whatever became of
    /// them with the hand alone.
    pub audits: usize,
    /// Kept demonstrations of each pose that are replayed beside their place.
    pub perturbed: usize,
    /// Bearings at which each pose is seen: demonstrations are as good when they turn, with the object,
    /// about the robot's vertical axis.
    pub turns: usize,
    /// Noisy clouds at each bearing; one without noise comes with them.
    pub clouds: usize,
    /// Objects of the encoder's data.
    pub encoder_objects: Vec<String>,
    /// Clouds of each of them.
    pub encoder_clouds: usize,
}

/// Names of the presets and what they are for.
pub const PRESETS: [(&str, &str); 5] = [
    ("smoke", "less than a minute: the whole way at toy size"),
    ("small", "minutes: two objects, 24 poses each, 32 demonstrations of each"),
    ("variants", "made models/paper: 220 poses each of a box in 2 proportions and a bottle in 8"),
    ("paper", "the paper's size: K = 192 object poses, M = 256 demonstrations of each"),
    (
        "families",
        "the training objects of all families, some in several proportions, 28 poses each",
    ),
];

/// The objects that the paper's policies learn to grasp.
const TAUGHT: [&str; 2] = ["sugar_box", "bleach"];
/// The objects that the paper's encoder sees: the mustard bottle stays unseen.
const ENCODED: [&str; 4] = ["sugar_box", "bleach", "cracker_box", "soup_can"];

/// Proportions in preset `variants` of each object that the paper's policies learn to grasp: boxes are much alike,
/// bottles are not.
const TAUGHT_VARIANTS: [(&str, usize); 2] = [("sugar_box", 2), ("bleach", 8)];
/// Proportions there of each object that the encoder sees.
const ENCODED_VARIANTS: usize = 8;

/// Proportions in preset `families` of what is held to be harder than the others.
const FAMILY_VARIANTS: [(&str, usize); 3] = [("bleach", 16), ("sugar_box", 3), ("cracker_box", 3)];
/// Families whose objects come in two proportions: what is round looks the same from everywhere and has demonstrations
/// enough.
const ANGULAR: [&str; 2] = ["boxes", "bottles"];
/// Objects that no grasp of the search lifts.
const NOT_LIFTED: [&str; 1] = ["hammer"];

/// Objects, each in so many proportions, its own first.
fn with_variants(objects: impl IntoIterator<Item = (&'static str, usize)>) -> Vec<String> {
    let variant = |name: &str, k| if k == 0 { name.to_owned() } else { format!("{name}.{k}") };
    let all = |(name, count)| (0..count).map(move |k| variant(name, k));
    objects.into_iter().flat_map(all).collect()
}

impl DatasetConfig {
    /// A configuration by its name in [`PRESETS`].
    pub fn preset(name: &str, seed: u64) -> Option<Self> {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let small = Self {
            version: VERSION,
            seed,
            objects: owned(&TAUGHT),
            grasps_by_family: false,
            poses: 24,
            trajectories: 32,
            overlap: false,
            audits: 4,
            perturbed: 1,
            turns: 4,
            clouds: 4,
            encoder_objects: owned(&ENCODED),
            encoder_clouds: 1000,
        };
        Some(match name {
            "smoke" => Self {
                objects: owned(&TAUGHT[..1]),
                poses: 3,
                trajectories: 4,
                audits: 1,
                turns: 2,
                encoder_objects: owned(&TAUGHT[..1]),
                encoder_clouds: 150,
                ..small
            },
            "small" => small,
            "variants" => Self {
                objects: with_variants(TAUGHT_VARIANTS),
                encoder_objects: with_variants(ENCODED.map(|name| (name, ENCODED_VARIANTS))),
                poses: 220,
                trajectories: 2,
                overlap: true,
                audits: 0,
                perturbed: 0,
                turns: 8,
                encoder_clouds: 900,
                ..small
            },
            "paper" => Self {
                poses: 96,
                trajectories: 256,
                audits: 11,
                perturbed: 3,
                turns: 8,
                encoder_clouds: 9000,
                ..small
            },
            "families" => {
                let taught = CATALOG.iter().filter(|entry| entry.is_for_training());
                // What no grasp lifts has no demonstrations.
                let lifted = taught.clone().filter(|entry| !NOT_LIFTED.contains(&entry.name));
                let proportions = |entry: &Entry| match FAMILY_VARIANTS
                    .iter()
                    .find(|(name, _)| *name == entry.name)
                {
                    Some((_, count)) => *count,
                    None if ANGULAR.contains(&entry.family) => 2,
                    None => 1,
                };
                Self {
                    encoder_objects: with_variants(taught.map(|e| (e.name, proportions(e)))),
                    objects: with_variants(lifted.map(|e| (e.name, proportions(e)))),
                    grasps_by_family: true,
                    poses: 28,
                    trajectories: 2,
                    overlap: true,
                    audits: 0,
                    perturbed: 0,
                    turns: 8,
                    encoder_clouds: 500,
                    ..small
                }
            }
            _ => return None,
        })
    }

    /// The same for one other object: demonstrations and the encoder's clouds.
    pub fn of_object(self, name: &str) -> Self {
        Self { objects: vec![name.to_owned()], encoder_objects: vec![name.to_owned()], ..self }
    }

    /// All objects, each once.
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
    fn presets_have_the_sizes_that_they_are_named_for() {
        for (name, _) in PRESETS {
            assert!(DatasetConfig::preset(name, 0).is_some(), "{name}");
        }
        assert!(DatasetConfig::preset("huge", 0).is_none());
        let paper = DatasetConfig::preset("paper", 0).unwrap();
        assert_eq!((paper.poses * paper.objects.len(), paper.trajectories), (192, 256));
        assert_eq!(paper.encoder_clouds * paper.encoder_objects.len(), 36_000);
        assert!(paper.audits * 192 >= 2000 && paper.perturbed * 192 >= 500);
        assert!(!paper.all_objects().contains(&"mustard"));
        let variants = DatasetConfig::preset("variants", 0).unwrap();
        assert_eq!(variants.objects[..2], ["sugar_box", "sugar_box.1"].map(str::to_owned));
        assert!(variants.objects.len() == 10 && !variants.all_objects().contains(&"mustard"));
        let families = DatasetConfig::preset("families", 0).unwrap();
        assert!(families.objects.len() >= 48);
        assert!(!families.all_objects().contains(&"jam_jar"), "jars are held out");
    }
}
