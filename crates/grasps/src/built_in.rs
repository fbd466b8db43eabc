//! Grasps that come with the project, as `ngf grasps` found them.

use crate::search::GraspSet;

/// The grasps for an object of this file name; `None` if there are none.
pub fn built_in(name: &str) -> Option<GraspSet> {
    let text = match name {
        "sugar_box" => include_str!("../../../assets/grasps/sugar_box.json"),
        "bleach" => include_str!("../../../assets/grasps/bleach.json"),
        _ => return None,
    };
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
        assert!(built_in("mustard").is_none());
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
