//! Objects that come with the project, by family.

use crate::object::{Object, ObjectFile};
use crate::proportions::Proportions;

/// An object file of the project.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Name of the file without its ending.
    pub name: &'static str,
    /// Family: the folder of the file.
    pub family: &'static str,
    /// Its text, as JSON.
    text: &'static str,
}

/// Look-alikes of the objects of the paper; the family of their scans.
pub const LOOK_ALIKES: &str = "ycb";

/// Families that no network of the project learns from.
const HELD_OUT: [&str; 3] = ["jars", "sprays", "toys"];

/// Whose grasps the objects of a family are tried with first. Those of the paper's objects come from the longest search,
/// and a jar is grasped as a can is, a spray as a bottle.
const EXEMPLARS: [(&str, &str); 10] = [
    ("boxes", "sugar_box"),
    ("cans", "soup_can"),
    ("bottles", "bleach"),
    ("bowls", "rice_bowl"),
    ("mugs", "coffee_mug"),
    ("tools", "torch"),
    ("balls", "softball"),
    ("jars", "soup_can"),
    ("sprays", "bleach"),
    ("toys", "wooden_block"),
];

/// The object of the paper that neither encoder nor policy sees before it is tried (paper §IV).
const UNSEEN: &str = "mustard";

macro_rules! catalog {
    ($($family:literal: $($name:literal),*;)*) => {
        &[$($(Entry {
            name: $name,
            family: $family,
            text: include_str!(concat!(env!("OUT_DIR"), "/", $family, "/", $name, ".json")),
        }),*),*]
    };
}

/// All objects, look-alikes first.
pub const CATALOG: &[Entry] = catalog! {
    "ycb": "sugar_box", "bleach", "cracker_box", "soup_can", "mustard";
    "boxes": "biscuit_box", "gelatin_box", "juice_carton", "milk_carton", "pasta_box", "soap_box", "tea_box", "toothpaste_box";
    "cans": "bean_can", "cocoa_tin", "coffee_tin", "corn_can", "energy_can", "soda_can", "tomato_can";
    "bottles": "beer_bottle", "dish_soap", "ketchup_bottle", "sauce_bottle", "shampoo_bottle", "vinegar_bottle", "water_bottle", "wine_bottle";
    "bowls": "custard_cup", "dessert_cup", "ramekin", "rice_bowl", "salad_bowl", "soup_bowl";
    "mugs": "beer_mug", "camping_mug", "coffee_mug", "espresso_cup", "measuring_cup", "tall_mug", "tea_cup";
    "tools": "brush", "glue_gun", "hammer", "mallet", "screwdriver", "tape_roll", "torch";
    "balls": "apple", "avocado", "baseball", "lemon", "orange", "softball", "tennis_ball";
    "jars": "honey_jar", "jam_jar", "mustard_jar", "peanut_butter", "pickle_jar", "spice_jar";
    "sprays": "bath_spray", "hair_spray", "insect_spray", "kitchen_spray", "plant_spray", "window_spray";
    "toys": "doll", "duck", "ring_tower", "rocket", "toy_car", "wooden_block";
};

impl Entry {
    /// The file.
    pub fn file(&self) -> Result<ObjectFile, String> {
        ObjectFile::parse(self.text)
    }

    /// Whether networks may learn from it.
    pub fn is_for_training(&self) -> bool {
        !HELD_OUT.contains(&self.family) && self.name != UNSEEN
    }
}

/// Objects of one family.
pub fn of_family(family: &str) -> impl Iterator<Item = &'static Entry> {
    CATALOG.iter().filter(move |entry| entry.family == family)
}

impl Object {
    /// The object that comes with the project under this name (file name without ending), or `name.k`, its k-th
    /// variant of other proportions, from 1.
    pub fn built_in(name: &str) -> Option<Self> {
        let (base, variant) = base_of(name)?;
        let entry = CATALOG.iter().find(|entry| entry.name == base)?;
        let object = entry.file().ok()?.object().ok()?;
        if variant == 0 {
            return Some(object);
        }
        object.reshaped(name, &Proportions::of_variant(variant)).ok()
    }
}

/// The object whose grasps those like this one are tried with first, for whoever wants them grasped alike; a look-alike
/// is its own.
pub fn exemplar_of(name: &str) -> Option<&'static str> {
    let entry = CATALOG.iter().find(|entry| entry.name == name)?;
    let of_family = EXEMPLARS.iter().find(|(family, _)| *family == entry.family);
    Some(of_family.map_or(entry.name, |(_, exemplar)| exemplar))
}

/// The object that a variant is one of, and its number; 0 for the object itself.
pub fn base_of(name: &str) -> Option<(&str, u32)> {
    match name.split_once('.') {
        None => Some((name, 0)),
        Some((base, number)) => Some((base, number.parse().ok().filter(|number| *number > 0)?)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use std::collections::BTreeSet;
    use std::path::Path;

    #[test]
    fn built_in_objects_are_sound() {
        for entry in CATALOG {
            let name = entry.name;
            let object = entry.file().unwrap().object().unwrap();
            let [min, max] = object.bounds;
            assert!(min.z.abs() < 1e-6 && (min.x + max.x).abs() < 1e-5, "{name}: {min} {max}");
            let com = object.center_of_mass;
            assert!(com.cmpgt(min).all() && com.cmplt(max).all(), "{name}: centre of mass {com}");
            let solid = crate::mesh::solid(&object.mesh, true).unwrap();
            let density = object.mass / solid.volume as f32;
            assert!((100.0..2500.0).contains(&density), "{name}: {density} kg/m3");
            let narrow = (max - min).truncate().min_element();
            assert!(narrow < 0.13 && max.z > 0.025 && object.mass <= 1.25, "{name}: {max}");
        }
    }

    #[test]
    fn variants_have_other_proportions_each() {
        let of = |name: &str| Object::built_in(name).unwrap();
        let bleach = of("bleach");
        let names = ["bleach.1", "bleach.2", "bleach.3", "bleach.4"];
        for (k, object) in names.map(of).iter().enumerate() {
            let wanted = Proportions::of_variant(k as u32 + 1);
            let ratio = object.size() / bleach.size();
            assert!((ratio - wanted.scale).abs().max_element() < 1e-4, "{ratio}, {wanted:?}");
            // What sinks leaves less of a bottle, which narrows to the top, and its weight lower.
            let low = |object: &Object| object.center_of_mass.z / object.size().z;
            assert_eq!(low(object) < low(&bleach), wanted.sink > 0.0, "{wanted:?}");
        }
        for nonsense in ["bleach.", "bleach.0", "bleach.x", "teapot.1", "bleach.1.2"] {
            assert!(Object::built_in(nonsense).is_none(), "{nonsense}");
        }
    }

    #[test]
    fn look_alikes_have_the_extents_of_the_scans() {
        // Bounding boxes of the YCB scans (mm).
        let scans = [
            ("sugar_box", [49.5, 94.2, 176.0]),
            ("bleach", [102.4, 67.7, 250.6]),
            ("cracker_box", [71.8, 164.0, 213.4]),
            ("soup_can", [67.9, 67.8, 102.0]),
            ("mustard", [97.2, 66.6, 191.4]),
        ];
        for (name, wanted) in scans {
            let [min, max] = Object::built_in(name).unwrap().bounds;
            let got = (max - min) * 1000.0;
            let error = (got - Vec3::from_array(wanted)).abs().max_element();
            assert!(error < 4.0, "{name}: {got} mm against {wanted:?} mm");
        }
    }

    #[test]
    fn the_catalog_lists_every_file_once() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/objects");
        let mut files = BTreeSet::new();
        for family in folder.read_dir().unwrap().map(|entry| entry.unwrap().path()) {
            for file in family.read_dir().unwrap().map(|entry| entry.unwrap().path()) {
                let word = |path: &Path| path.file_stem().unwrap().to_str().unwrap().to_owned();
                files.insert((word(&family), word(&file)));
            }
        }
        let listed: BTreeSet<_> =
            CATALOG.iter().map(|e| (e.family.to_owned(), e.name.to_owned())).collect();
        assert_eq!(listed, files);
        let names: BTreeSet<_> = CATALOG.iter().map(|entry| entry.name).collect();
        assert!(names.len() == CATALOG.len(), "a name stands twice");
    }

    #[test]
    fn every_family_is_grasped_like_an_object_that_is_learned_from() {
        for entry in CATALOG {
            let exemplar = exemplar_of(entry.name).unwrap();
            let is_taught = |entry: &Entry| entry.name == exemplar && entry.is_for_training();
            let is_own = entry.name == exemplar;
            let is_held_out = HELD_OUT.contains(&entry.family);
            assert!(is_own || is_held_out || CATALOG.iter().any(is_taught), "{}", entry.name);
        }
        assert_eq!(exemplar_of("wine_bottle"), Some("bleach"));
        assert_eq!(exemplar_of("cracker_box"), Some("cracker_box"));
        assert_eq!(exemplar_of("bleach.2"), None);
    }

    #[test]
    fn families_are_held_out_as_a_whole() {
        let families: BTreeSet<_> = CATALOG.iter().map(|entry| entry.family).collect();
        assert!(HELD_OUT.iter().all(|family| families.contains(family)));
        let learned = CATALOG.iter().filter(|e| e.is_for_training() && e.family != LOOK_ALIKES);
        assert!(learned.count() >= 48 && CATALOG.len() >= 65);
    }
}
