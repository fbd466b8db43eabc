//! Grasps that come with the project, as `ngf grasps` found them.

use crate::search::GraspSet;

/// Name and file of each set.
macro_rules! sets {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../../assets/grasps/", $name, ".json")))),*]
    };
}

/// The objects that the policy learned to grasp.
const TAUGHT: &[(&str, &str)] = sets!["sugar_box" "bleach"];

/// The others, for datasets and the planner. The page does without them: a policy acts there, and half a megabyte is much to load.
#[cfg(not(target_family = "wasm"))]
const OTHERS: &[(&str, &str)] = sets![
    "cracker_box" "soup_can" "mustard" "biscuit_box" "gelatin_box" "juice_carton" "milk_carton" "pasta_box" "soap_box" "tea_box" "toothpaste_box" "bean_can" "cocoa_tin" "coffee_tin" "corn_can" "energy_can" "soda_can" "tomato_can" "beer_bottle" "dish_soap" "ketchup_bottle" "sauce_bottle" "shampoo_bottle" "vinegar_bottle" "water_bottle" "wine_bottle" "custard_cup" "dessert_cup" "ramekin" "rice_bowl"
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
    fn most_objects_that_were_searched_have_grasps() {
        let names = OTHERS.iter().map(|(name, _)| *name);
        let found: Vec<usize> = names
            .map(|name| {
                assert!(Object::built_in(name).is_some(), "{name} is no object");
                built_in(name).expect(name).grasps.len()
            })
            .collect();
        let graspable = found.iter().filter(|count| **count > 0).count();
        println!("{graspable} of {} objects have grasps", found.len());
        assert!(10 * graspable >= 9 * found.len(), "{graspable} of {}", found.len());
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
        // Nothing stands before the first kind.
        let first: Vec<_> = grasps.iter().filter(|grasp| grasp.kind == 0).cloned().collect();
        assert_eq!(place::poses_served(&robot, &object, &first), served[..1]);
    }
}
