//! A second robot from a second folder: the left Allegro hand, the mirror image of the right one, on the same arm.
//!
//! The test generates the folder from that of the right hand: y and all rotation axes are mirrored in the palm
//! frame, and links and joints get other names. Both folders pass through the same loader.

#![allow(clippy::unwrap_used, reason = "test helpers fail by panicking")]

use robot::collision_shapes::CollisionModel;
use robot::hand_model::LinkRole;
use robot::ik::{self, IkConfig};
use robot::{ARM_DOF, HAND_DOF, JointVector, KinematicTree, NUM_FINGERS, RobotDescription, Vector};
use std::fs::{create_dir_all, read_to_string, write};
use std::path::{Path, PathBuf};

/// Open hand (rad), as in `assets/scene/scene.toml`.
const OPEN: [f64; HAND_DOF] =
    [0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 1.2, 0.35, 0.15, 0.3];

const FINGER_PREFIXES: [&str; NUM_FINGERS] = ["index_", "middle_", "ring_", "thumb_"];

/// Signs of the components of a vector, and of an axial vector (rotation), under the reflection of y.
const POLAR: [f64; 3] = [1.0, -1.0, 1.0];
const AXIAL: [f64; 3] = [-1.0, 1.0, -1.0];

fn right_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/robot/iiwa7_allegro")
}

/// Loads the robot of a folder. The hand file is converted to JSON, as `build.rs` does for the standard robot.
fn load(folder: &Path) -> KinematicTree {
    let read = |name: &str| read_to_string(folder.join(name)).unwrap();
    let hand: serde_json::Value = toml::from_str(&read("hand.toml")).unwrap();
    let description = RobotDescription {
        urdf: &read("robot.urdf"),
        collision_spheres: &read("collision_spheres.json"),
        hand: &hand.to_string(),
    };
    KinematicTree::load(&description).unwrap()
}

fn is_hand_link(name: &str) -> bool {
    name == "palm" || FINGER_PREFIXES.iter().any(|finger| name.starts_with(finger))
}

/// Multiplies the numbers of a text by `signs`.
fn flip(numbers: &str, signs: &[f64]) -> String {
    let numbers = numbers.split_whitespace().zip(signs);
    let flipped = numbers.map(|(x, sign)| (sign * x.parse::<f64>().unwrap()).to_string());
    flipped.collect::<Vec<_>>().join(" ")
}

/// Mirrors the links of the hand, and the joints between them.
fn mirror_urdf(text: &str) -> String {
    let document = roxmltree::Document::parse(text).unwrap();
    let mut mirrored = text.to_owned();
    let mut edits = Vec::new();
    for element in document.root_element().children().filter(|node| node.is_element()) {
        let parent = element.children().find(|node| node.has_tag_name("parent"));
        let owner = parent.map_or_else(|| element.attribute("name"), |node| node.attribute("link"));
        if !is_hand_link(owner.unwrap()) {
            continue;
        }
        for node in element.descendants() {
            for attribute in node.attributes() {
                let signs = match (node.tag_name().name(), attribute.name()) {
                    ("origin", "xyz") => &POLAR[..],
                    ("origin", "rpy") | ("axis", "xyz") => &AXIAL,
                    ("inertia", "ixy" | "iyz") => &[-1.0],
                    _ => continue,
                };
                edits.push((attribute.range_value(), flip(attribute.value(), signs)));
            }
        }
    }
    assert!(edits.len() > 80, "{} mirrored attributes", edits.len());
    // From the end, so that the ranges before an edit stay valid.
    edits.sort_by_key(|(range, _)| std::cmp::Reverse(range.start));
    edits.into_iter().for_each(|(range, text)| mirrored.replace_range(range, &text));
    mirrored
}

fn mirror_spheres(text: &str) -> String {
    let mut file: serde_json::Value = serde_json::from_str(text).unwrap();
    for sphere in file["spheres"].as_array_mut().unwrap() {
        if is_hand_link(sphere["link"].as_str().unwrap()) {
            let y = sphere["center"][1].as_f64().unwrap();
            sphere["center"][1] = (-y).into();
        }
    }
    file.to_string()
}

fn mirror_hand(text: &str) -> String {
    let center = "center = [0.085, 0.0, 0.012]";
    assert!(text.contains(center));
    text.replace(center, "center = [0.085, -0.0, 0.012]").replace("_allegro\"", "_allegro_left\"")
}

/// Gives the links and joints of the hand the names of a left hand.
fn rename(text: String) -> String {
    let with_fingers = FINGER_PREFIXES.iter().fold(text, |text, finger| {
        text.replace(&format!("\"{finger}"), &format!("\"left_{finger}"))
    });
    with_fingers.replace("\"palm\"", "\"left_palm\"")
}

/// Converts the text of a file of the right hand to the left hand.
type Mirror = fn(&str) -> String;

/// Generates the folder of the left hand; `test` keeps concurrent tests apart.
fn left_folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test).join("iiwa7_allegro_left");
    create_dir_all(&folder).unwrap();
    let files: [(&str, Mirror); 3] = [
        ("robot.urdf", mirror_urdf),
        ("collision_spheres.json", mirror_spheres),
        ("hand.toml", mirror_hand),
    ];
    for (name, mirror) in files {
        let text = read_to_string(right_folder().join(name)).unwrap();
        write(folder.join(name), rename(mirror(&text))).unwrap();
    }
    folder
}

/// Right and left robot.
fn both_hands(test: &str) -> [KinematicTree; 2] {
    [load(&right_folder()), load(&left_folder(test))]
}

/// Joint positions (rad) within the limits.
fn sample(tree: &KinematicTree, seed: usize) -> JointVector {
    let limits = &tree.limits;
    JointVector::from_fn(|i, _| {
        let fraction = 0.5 + 0.5 * libm::sin((7 * seed + 3 * i) as f64);
        limits.lower[i] + fraction * (limits.upper[i] - limits.lower[i])
    })
}

/// A world point in the palm frame at the joint position `q`.
fn in_palm(tree: &KinematicTree, q: &JointVector, point: &Vector) -> Vector {
    tree.forward_kinematics(q).palm_pose().inverse_transform_point(&(*point).into()).coords
}

fn fingertips_in_palm(tree: &KinematicTree, q: &JointVector) -> [Vector; NUM_FINGERS] {
    tree.forward_kinematics(q).fingertips().map(|tip| in_palm(tree, q, &tip))
}

fn mirror(point: &Vector) -> Vector {
    Vector::new(point.x, -point.y, point.z)
}

#[test]
fn fingertips_of_left_hand_are_mirror_image_of_right_hand() {
    let [right, left] = both_hands("kinematics");
    assert_eq!(left.hand.name, "kuka_iiwa7_allegro_left");
    assert_eq!(left.limits, right.limits);
    assert_eq!(left.joints[ARM_DOF].name, "left_index_joint_0");
    for seed in 0..20 {
        let q = sample(&right, seed);
        let palms = [&right, &left].map(|tree| tree.forward_kinematics(&q).palm_pose());
        assert_eq!(palms[0], palms[1]);
        let tips = [&right, &left].map(|tree| fingertips_in_palm(tree, &q));
        for (right, left) in tips[0].iter().zip(&tips[1]) {
            assert!((mirror(right) - left).norm() < 1e-12, "{right} and {left}");
        }
    }
    // The index finger of the open right hand is on the side of positive y.
    let q = robot::joint_vector(&right.hand.arm.nominal, &OPEN);
    let [a, b] = [&right, &left].map(|tree| fingertips_in_palm(tree, &q)[0].y);
    assert!(a > 0.04 && b < -0.04, "{a} m and {b} m");
}

#[test]
fn closing_rates_close_both_hands_equally() {
    let [right, left] = both_hands("closing");
    // Mean distance of the three fingertips from that of the thumb.
    let gap = |tree: &KinematicTree, angle: f64| {
        let closing = &tree.hand.closing;
        let hand: [f64; HAND_DOF] = std::array::from_fn(|i| {
            let rates = if i < HAND_DOF - 4 { closing.finger_rates } else { closing.thumb_rates };
            OPEN[i] + if robot::is_flexion_joint(i) { angle * rates[i % 4 - 1] } else { 0.0 }
        });
        let q = robot::joint_vector(&tree.hand.arm.nominal, &hand);
        assert!(tree.limits.contains(&q, 0.0));
        let [fingers @ .., thumb] = fingertips_in_palm(tree, &q);
        fingers.iter().map(|tip| (tip - thumb).norm()).sum::<f64>() / fingers.len() as f64
    };
    let mut last = f64::INFINITY;
    for angle in [0.0, 0.2, 0.4, 0.6] {
        let [right, left] = [&right, &left].map(|tree| gap(tree, angle));
        assert!((right - left).abs() < 1e-12, "{right} m and {left} m");
        assert!(right < last, "closing by {angle} opens from {last} m to {right} m");
        last = right;
    }
}

#[test]
fn shapes_spheres_and_masses_of_left_hand_are_mirrored() {
    let [right, left] = both_hands("shapes");
    let q = sample(&right, 3);
    let spheres = [&right, &left].map(|tree| tree.collision_spheres().unwrap());
    let kinematics = [&right, &left].map(|tree| tree.forward_kinematics(&q));
    let hand = spheres[0].iter().zip(&spheres[1]).filter(|(a, _)| is_hand_link(&a.link));
    let mut count = 0;
    for (a, b) in hand {
        let [right, left] = [(&right, &kinematics[0], a), (&left, &kinematics[1], b)].map(
            |(tree, kinematics, sphere)| {
                let pose = kinematics.world_from_body[sphere.body];
                in_palm(tree, &q, &pose.transform_point(&sphere.center.into()).coords)
            },
        );
        assert!((mirror(&right) - left).norm() < 1e-12 && a.radius == b.radius, "{}", b.link);
        count += 1;
    }
    assert_eq!(count, 36);
    // The last arm body includes the palm, and only the palm is mirrored.
    let fingers = right.bodies.iter().zip(&left.bodies).skip(ARM_DOF + 1);
    for (a, b) in fingers {
        assert!((a.mass - b.mass).abs() < 1e-12, "{}", b.name);
        let moments = |body: &robot::tree::Body| {
            let mut moments: [f64; 3] = body.inertia.symmetric_eigenvalues().into();
            moments.sort_by(f64::total_cmp);
            Vector::from(moments)
        };
        assert!((moments(a) - moments(b)).amax() < 1e-12, "{}", b.name);
    }
    let roles = |tree: &KinematicTree, role: LinkRole| {
        tree.bodies.iter().flat_map(|body| &body.shapes).filter(|shape| shape.role == role).count()
    };
    for tree in [&right, &left] {
        // A distal link has a box and a capsule.
        assert_eq!(roles(tree, LinkRole::Distal), 2 * NUM_FINGERS);
        assert_eq!(roles(tree, LinkRole::FingerBase), NUM_FINGERS + 1);
        let model = CollisionModel::new(tree);
        assert!((ARM_DOF..=robot::DOF).all(|body| !model.body_shapes(body).is_empty()));
    }
}

#[test]
fn inverse_kinematics_of_both_robots_agree_on_one_arm() {
    let [right, left] = both_hands("ik");
    let solutions = [&right, &left].map(|tree| {
        let nominal = robot::joint_vector(&tree.hand.arm.nominal, &OPEN);
        let mut target = tree.forward_kinematics(&nominal).palm_pose();
        target.translation.vector += Vector::new(0.05, -0.1, 0.1);
        ik::solve(tree, &target, &nominal, &IkConfig::standard(tree)).unwrap()
    });
    assert_eq!(solutions[0], solutions[1]);
}
