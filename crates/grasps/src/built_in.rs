//! Grasps that come with the project, as `ngf grasps` found them.

use crate::GraspSet;

/// Name and file of each set.
macro_rules! sets {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../../assets/grasps/", $name, ".json")))),*]
    };
}

/// The objects that the policy learned to grasp.
const TAUGHT: &[(&str, &str)] = sets!["sugar_box" "bleach"];

/// The others, for datasets and the planner. The page does without them: a policy acts there, and a megabyte is much to load.
#[cfg(not(target_family = "wasm"))]
const OTHERS: &[(&str, &str)] = sets![
    "cracker_box" "soup_can" "mustard" "biscuit_box" "gelatin_box" "juice_carton" "milk_carton" "pasta_box" "soap_box" "tea_box" "toothpaste_box" "bean_can" "cocoa_tin" "coffee_tin" "corn_can" "energy_can" "soda_can" "tomato_can" "beer_bottle" "dish_soap" "ketchup_bottle" "sauce_bottle" "shampoo_bottle" "vinegar_bottle" "water_bottle" "wine_bottle" "custard_cup" "dessert_cup" "ramekin" "rice_bowl" "salad_bowl" "soup_bowl" "beer_mug" "camping_mug" "coffee_mug" "espresso_cup" "measuring_cup" "tall_mug" "tea_cup" "brush" "glue_gun" "hammer" "mallet" "screwdriver" "tape_roll" "torch" "apple" "avocado" "baseball" "lemon" "orange" "softball" "tennis_ball" "honey_jar" "jam_jar" "mustard_jar" "peanut_butter" "pickle_jar" "spice_jar" "bath_spray" "hair_spray" "insect_spray" "kitchen_spray" "plant_spray" "window_spray" "doll" "duck" "ring_tower" "rocket" "toy_car" "wooden_block"
];
#[cfg(target_family = "wasm")]
const OTHERS: &[(&str, &str)] = &[];

/// The grasps for an object of this file name; `None` if they are not there. A search may have found none.
pub fn built_in(name: &str) -> Option<GraspSet> {
    let (_, text) = TAUGHT.iter().chain(OTHERS).find(|(of, _)| *of == name)?;
    serde_json::from_str(text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Robot, place};
    use geometry::catalog::CATALOG;
    use geometry::object::Object;

    #[test]
    fn grasps_of_the_project_are_read_and_numbered_by_kind() {
        for name in ["sugar_box", "bleach"] {
            let grasps = built_in(name).expect("a set").grasps;
            let kinds: Vec<usize> = grasps.iter().map(|grasp| grasp.kind).collect();
            assert!(kinds.is_sorted() && kinds[0] == 0 && kinds.len() >= 2, "{name}: {kinds:?}");
        }
        assert!(built_in("teapot").is_none());
    }

    #[test]
    fn nine_of_ten_objects_have_grasps() {
        let found: Vec<(&str, usize)> = CATALOG
            .iter()
            .map(|entry| (entry.name, built_in(entry.name).expect(entry.name).grasps.len()))
            .collect();
        let without: Vec<&str> =
            found.iter().filter(|(_, count)| *count == 0).map(|(name, _)| *name).collect();
        println!("without grasps: {without:?} of {}", found.len());
        assert!(10 * without.len() <= found.len(), "{without:?} of {}", found.len());
        assert_eq!(TAUGHT.len() + OTHERS.len(), CATALOG.len(), "a set is of no object");
    }

    #[test]
    fn the_bleach_bottle_is_within_reach_nearly_wherever_it_stands() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("bleach").unwrap();
        let served = place::poses_served(&robot, &object, &built_in("bleach").unwrap().grasps);
        let all: usize = served.iter().sum();
        println!("{served:?} of {}", place::REACH_POSES);
        assert!(all >= place::REACH_POSES * 97 / 100, "{served:?}");
    }

    #[test]
    fn the_first_kind_serves_most_object_poses_and_each_pose_is_served_by_one() {
        let robot = Robot::standard().unwrap();
        let object = Object::built_in("sugar_box").unwrap();
        let grasps = built_in("sugar_box").unwrap().grasps;
        let served = place::poses_served(&robot, &object, &grasps);
        let all: usize = served.iter().sum();
        println!("{served:?} of {}", place::REACH_POSES);
        assert!(all <= place::REACH_POSES && all > place::REACH_POSES * 95 / 100, "{served:?}");
        assert!(served.iter().all(|poses| *poses <= served[0]), "{served:?}");
        // Nothing stands before the first kind but that with the arm drawn in others are preferred, where there are any.
        let first: Vec<_> = grasps.iter().filter(|grasp| grasp.kind == 0).cloned().collect();
        let alone = place::poses_served(&robot, &object, &first);
        assert!(alone.len() == 1 && alone[0] >= served[0] && alone[0] <= all, "{alone:?}");
    }
}
